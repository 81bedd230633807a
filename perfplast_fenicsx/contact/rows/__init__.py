"""Form rows of inequalities, the jump basis, and the motions that rows leave free."""
