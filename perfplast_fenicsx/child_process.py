"""Processes that a rank starts, and that are no ranks themselves."""

import os
import site
from pathlib import Path

REFUSED = 2
"""Exit status of a program of ours whose last words are a sentence that says what is wrong."""


def environment_apart() -> dict[str, str]:
    """Return the environment of such a process: without what MPI's launchers set."""
    hidden = ("OMPI_", "PMIX_", "PRTE_", "PMI_", "MPI_", "HYDRA_")
    return {key: value for key, value in os.environ.items() if not key.startswith(hidden)}


def environment_for_gmsh(home: Path) -> dict[str, str]:
    """Return the same for a program that starts gmsh, which writes settings into the user's home.

    Args:
        home: A folder that serves as such.
    """
    homes = {"HOME": str(home), "XDG_CONFIG_HOME": str(home)}
    return environment_apart() | homes | {"PYTHONUSERBASE": site.getuserbase()}


def environment_with_package(environment: dict[str, str] | None = None) -> dict[str, str]:
    """The same for a program of this package, which it finds wherever this one has found it."""
    environment = environment_apart() if environment is None else environment
    places = [environment.get("PYTHONPATH"), str(Path(__file__).parents[1])]
    return environment | {"PYTHONPATH": os.pathsep.join(filter(None, places))}
