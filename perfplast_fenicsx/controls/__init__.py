"""Define the controls of ``[loading]``: each checks its case and computes the results."""
