"""Formulations of contact, one a module."""
