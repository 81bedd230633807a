"""Define the load factors that a limit analysis can compute, and its results."""
