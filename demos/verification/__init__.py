"""Verification cases with exact solutions. Each case is a demo; ``verify.py`` runs all of them."""
