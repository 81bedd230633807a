"""Tests of models from other programs."""
