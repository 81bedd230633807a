"""Processes that a rank starts, and that are no ranks themselves."""

import os


def environment_apart() -> dict[str, str]:
    """The environment of such a process: without what MPI's launchers set."""
    hidden = ("OMPI_", "PMIX_", "PRTE_", "PMI_", "MPI_", "HYDRA_")
    return {key: value for key, value in os.environ.items() if not key.startswith(hidden)}
