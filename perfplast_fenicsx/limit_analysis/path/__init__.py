"""Compute limit loads with a loading path."""
