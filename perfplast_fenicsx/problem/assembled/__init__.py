"""Assemble the data that a problem needs once: spaces, loads, prescribed motion and glued rows."""
