"""Solve linear systems in the jump basis."""
