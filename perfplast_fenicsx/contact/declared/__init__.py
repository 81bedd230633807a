"""Declare contact: pairs, ties, obstacles, friction."""
