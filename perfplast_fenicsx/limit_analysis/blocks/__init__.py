"""Compute limit loads of rigid blocks, which collapse only through their joints."""
