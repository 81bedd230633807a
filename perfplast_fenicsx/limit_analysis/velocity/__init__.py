"""Strict upper bounds: mechanisms of the body."""
