"""Compute limit loads of the finite element mesh."""
