"""Nodes, facets, normals and gaps of surfaces."""
