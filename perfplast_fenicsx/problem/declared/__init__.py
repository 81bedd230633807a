"""What is said of a problem: loads, supports, stages. No DOLFINx."""
