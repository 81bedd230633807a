"""Evaluate states and resultants, and check them."""
