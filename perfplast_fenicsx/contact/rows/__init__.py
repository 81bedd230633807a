"""Rows of inequalities, the jump basis, and motions that they leave free."""
