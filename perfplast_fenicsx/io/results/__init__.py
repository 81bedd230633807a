"""Write and read result folders: fields, checkpoints, summaries."""
