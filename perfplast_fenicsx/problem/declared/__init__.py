"""Declarations of a problem: loads, supports, stages. No DOLFINx."""
