"""Declarations of contact: pairs, ties, obstacles, friction."""
