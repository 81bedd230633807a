"""Verification cases with exact solutions; each is a demo, and ``verify.py`` runs all of them."""
