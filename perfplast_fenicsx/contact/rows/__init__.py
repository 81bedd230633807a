"""Form rows of inequalities, the jump basis, and motions that the rows leave free."""
