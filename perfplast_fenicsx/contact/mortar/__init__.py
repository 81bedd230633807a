"""Implement mortar contact: integrals over opposite facets."""
