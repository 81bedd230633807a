"""Compute shakedown loads: the largest ranges of varying loads to which bodies shake down."""
