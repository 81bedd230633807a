"""Declare a problem: loads, supports, stages. These modules do not import DOLFINx."""
