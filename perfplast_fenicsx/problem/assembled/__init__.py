"""Assembled objects of a problem."""
