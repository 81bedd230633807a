"""Strict lower bounds: stresses in equilibrium."""
