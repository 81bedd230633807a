"""Result folders: fields, checkpoints, summaries."""
