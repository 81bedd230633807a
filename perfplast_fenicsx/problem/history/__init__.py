"""Histories of loads and motions."""
