"""Contact in the mean: integrals over facing facets."""
