"""Compute strict lower bounds: stresses in equilibrium."""
