"""Read case files."""
