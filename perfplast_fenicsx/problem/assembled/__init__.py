"""What is assembled of what is said."""
