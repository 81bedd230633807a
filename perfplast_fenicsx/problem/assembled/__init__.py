"""Objects that a problem assembles once: spaces, loads, prescribed motion and glued rows."""
