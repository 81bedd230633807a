"""What ``[loading]`` may ask for: each control checks its case and finds its answer."""
