"""Compute limit loads of rigid blocks, which fail only at their joints."""
