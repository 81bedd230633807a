"""Define questions about limit loads, and their answers."""
