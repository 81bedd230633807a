"""Prepare the environment of processes that a rank starts, and that are not ranks themselves."""

import os
import site
from pathlib import Path

REFUSED = 2
"""Exit status of our own programs whose last line of output is an error message."""


def environment_apart() -> dict[str, str]:
    """Return an environment for such a process, without the variables of MPI launchers."""
    hidden = ("OMPI_", "PMIX_", "PRTE_", "PMI_", "MPI_", "HYDRA_")
    return {key: value for key, value in os.environ.items() if not key.startswith(hidden)}


def environment_for_gmsh(home: Path) -> dict[str, str]:
    """Return such an environment for gmsh, which writes settings into the home folder.

    Args:
        home: A folder that serves as home.
    """
    homes = {"HOME": str(home), "XDG_CONFIG_HOME": str(home)}
    return environment_apart() | homes | {"PYTHONUSERBASE": site.getuserbase()}


def environment_with_package(environment: dict[str, str] | None = None) -> dict[str, str]:
    """Return such an environment for a program of this package, with the package on its path."""
    environment = environment_apart() if environment is None else environment
    places = [environment.get("PYTHONPATH"), str(Path(__file__).parents[1])]
    return environment | {"PYTHONPATH": os.pathsep.join(filter(None, places))}
