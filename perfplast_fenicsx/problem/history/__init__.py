"""Apply histories of loads and motions."""
