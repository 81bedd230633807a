"""Limit loads by the loading path."""
