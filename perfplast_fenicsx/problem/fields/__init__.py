"""Evaluate the fields that each step uses."""
