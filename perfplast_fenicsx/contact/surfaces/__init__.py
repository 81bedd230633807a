"""Collect the nodes, facets, normals and gaps of surfaces."""
