"""Implement formulations of contact, one per module."""
