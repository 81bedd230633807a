"""Combinations of statements in a case with questions about the case."""
