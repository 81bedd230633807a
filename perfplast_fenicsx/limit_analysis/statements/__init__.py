"""Define the questions of a limit analysis, and the results that answer them."""
