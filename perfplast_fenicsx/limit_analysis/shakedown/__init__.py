"""Loads that vary again and again: what of them bodies adapt to."""
