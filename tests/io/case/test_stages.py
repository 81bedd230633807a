"""Stages in case files: what they mean, and what is refused in a sentence."""
