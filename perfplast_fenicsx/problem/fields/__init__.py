"""What is evaluated in each step."""
