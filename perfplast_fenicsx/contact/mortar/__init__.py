"""Implement mortar contact: integrals over facing facets."""
