"""Compute strict upper bounds from mechanisms of the body."""
