"""Total FETI: contact quadratic programs by domain decomposition, in their dual unknowns."""
