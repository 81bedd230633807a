"""Compute limit loads along a loading path."""
