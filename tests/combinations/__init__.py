"""Combinations of statements of a case with questions about it."""
