"""Questions about limit loads, and their answers."""
