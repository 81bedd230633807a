"""Solve quadratic programs with contact bounds."""
