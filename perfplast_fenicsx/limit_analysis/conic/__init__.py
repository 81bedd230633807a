"""The interior point iteration: cones, unknowns, steps."""
