"""Declare contacts, ties, obstacles and friction."""
