"""What is asked of a limit load, and what is answered."""
