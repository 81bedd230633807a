"""Evaluate the fields that each step needs."""
