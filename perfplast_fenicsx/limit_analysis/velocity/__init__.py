"""Compute strict upper bounds: mechanisms of the body."""
