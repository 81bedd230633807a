"""Compute limit loads by a loading path."""
