"""Limit loads of rigid blocks, which collapse by their joints alone."""
