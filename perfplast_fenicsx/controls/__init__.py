"""The controls of ``[loading]``: each checks its case and finds its answer."""
