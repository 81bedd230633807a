"""The sources of the documentation site, and the modules that make parts of it."""
