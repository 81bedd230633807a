"""Collect the cells, facets and interfaces of the bodies for strict bounds."""
