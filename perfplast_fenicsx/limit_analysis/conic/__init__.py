"""Implement the interior point iteration: cones, unknowns, steps."""
