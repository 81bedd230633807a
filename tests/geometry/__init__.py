"""Tests of perfplast_fenicsx.geometry."""
