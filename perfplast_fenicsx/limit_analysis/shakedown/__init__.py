"""Compute shakedown loads: the largest range of varying loads to which bodies shake down."""
