"""Linear systems in the jump basis."""
