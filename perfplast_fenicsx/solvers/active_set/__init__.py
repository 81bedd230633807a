"""Quadratic programs with contact bounds."""
