"""Compute strict lower bounds from stresses in equilibrium."""
