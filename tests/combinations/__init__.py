"""What goes with what: statements of a case against questions that are asked of it."""
