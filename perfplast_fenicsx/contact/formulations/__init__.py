"""Implement contact formulations, one in each module."""
