"""States, resultants and what judges them."""
