"""Limit loads of the mesh."""
