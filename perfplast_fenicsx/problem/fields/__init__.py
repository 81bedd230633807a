"""Fields that are evaluated in each step."""
