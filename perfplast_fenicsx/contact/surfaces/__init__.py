"""Collect nodes, facets, normals and gaps of surfaces."""
