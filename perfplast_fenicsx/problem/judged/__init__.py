"""Evaluate states and resultants, and assess them."""
