"""Solve contact quadratic programs by Total FETI: domain decomposition in dual unknowns."""
