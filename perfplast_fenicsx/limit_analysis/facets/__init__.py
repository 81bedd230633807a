"""Collect cells, facets and interfaces of the body of a bound."""
