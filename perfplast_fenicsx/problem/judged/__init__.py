"""States, resultants and their checks."""
