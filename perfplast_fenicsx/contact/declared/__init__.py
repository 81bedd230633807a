"""What is said of contact: pairs, ties, obstacles, friction."""
