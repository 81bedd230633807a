"""Compute strict bounds of the body, on one mesh and on adapted meshes."""
