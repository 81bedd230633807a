"""Compute limit loads of the mesh."""
