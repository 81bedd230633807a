"""Find faults of the environment before compiled modules are imported, and set up child processes.

A process needs exactly one version of each of DOLFINx, PETSc and MPI. A mixture of two versions
ends in a crash or a hang far from its cause. So this module checks which packages are installed.
It needs only the standard library.
"""

import os
import platform
import shutil
import site
import sys
import sysconfig
from dataclasses import dataclass
from importlib import metadata, util
from pathlib import Path

INSTALL = "docs/howto/install.md"

WHEEL = "dolfinx-solver-real"
"""Distribution of DOLFINx on PyPI with a PETSc of real numbers."""

COMPLEX = "dolfinx-solver-complex"

FOREIGN = ("petsc", "petsc4py", "slepc", "slepc4py")
"""Distributions that overwrite or shadow files of :data:`WHEEL`."""

SPACE = 100e6
"""Disk space that compiled forms need (bytes)."""


@dataclass(frozen=True)
class Surroundings:
    """Properties of an environment that decide whether the program can start.

    Attributes:
        python: Version of Python.
        system: Name of the operating system (:func:`platform.system`).
        machine: Name of the processor (:func:`platform.machine`).
        libc: Name and version of the C library.
        distributions: Installed distributions among those that matter.
        dolfinx: Folder of the package ``dolfinx``; None if it is missing.
        petsc4py: Folder of the package ``petsc4py``; None if it is missing.
    """

    python: tuple[int, int]
    system: str
    machine: str
    libc: tuple[str, str]
    distributions: frozenset[str]
    dolfinx: Path | None
    petsc4py: Path | None

    def fault(self) -> str | None:
        """Return why the program cannot start, in one sentence; None if it can start."""
        if {WHEEL, COMPLEX} <= self.distributions:
            return (
                f"{WHEEL} and {COMPLEX} are both installed and overwrite each other's files;"
                f" uninstall both, then pip install {WHEEL}."
            )
        if COMPLEX in self.distributions:
            return (
                f"{COMPLEX} has a PETSc of complex numbers, but real numbers are needed; pip"
                f" uninstall {COMPLEX}, then pip install {WHEEL}."
            )
        foreign = [name for name in FOREIGN if name in self.distributions]
        if WHEEL in self.distributions and foreign:
            return (
                f"{', '.join(foreign)} and {WHEEL}, which has its own PETSc, are in one"
                f" environment; uninstall the former and reinstall {WHEEL}, or use a virtual"
                " environment without the system's packages."
            )
        if self.dolfinx is None:
            return self._no_dolfinx()
        shadowed = self.petsc4py is not None and self.petsc4py.parent != self.dolfinx.parent
        if WHEEL in self.distributions and shadowed:
            return (
                f"Python would import petsc4py from {self.petsc4py}, not from {WHEEL}; remove"
                " that folder from PYTHONPATH."
            )
        return None

    def _no_dolfinx(self) -> str:
        """Return why DOLFINx is missing, and where to get it."""
        elsewhere = f"take it from conda-forge or from Debian 13 ({INSTALL})"
        if self.system != "Linux" or self.machine != "x86_64":
            where = f"{self.system} on {self.machine}"
            return f"DOLFINx is missing, and PyPI has no DOLFINx for {where}; {elsewhere}."
        name, version = self.libc
        if name != "glibc":
            return (
                "DOLFINx is missing, and PyPI's version needs glibc, which this system lacks (musl,"
                f" as in Alpine?); {elsewhere}."
            )
        if _numbers(version) < [2, 34]:
            return f"DOLFINx is missing, and PyPI's needs glibc ≥ 2.34, not {version}; {elsewhere}."
        if self.python < (3, 12):
            return (
                f"DOLFINx is missing, and PyPI's needs Python ≥ 3.12, not {self.python[0]}."
                f"{self.python[1]} ({sys.executable}); create the virtual environment with a newer"
                " Python."
            )
        return "DOLFINx is missing; pip install 'perfplast-fenicsx[all]'."


def surroundings() -> Surroundings:
    """Return the surroundings of this process."""
    known = (WHEEL, COMPLEX, *FOREIGN)
    return Surroundings(
        python=sys.version_info[:2],
        system=platform.system(),
        machine=platform.machine(),
        libc=platform.libc_ver(),
        distributions=frozenset(name for name in known if version_of(name)),
        dolfinx=_folder("dolfinx"),
        petsc4py=_folder("petsc4py"),
    )


def version_of(distribution: str) -> str | None:
    """Return the version of an installed distribution; None if it is not installed."""
    try:
        return metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return None


def forms_folder() -> Path:
    """Return the folder in which DOLFINx caches compiled forms."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "fenics"


def forms_fault() -> str | None:
    """Return why forms cannot be compiled or cached, in one sentence; None if they can."""
    folder = forms_folder()
    existing = folder
    while not existing.exists() and existing != existing.parent:
        existing = existing.parent
    if not existing.is_dir() or not os.access(existing, os.W_OK):
        return (
            f"compiled forms cannot be stored in {folder}: {existing} is not writable; set"
            " XDG_CACHE_HOME to a writable folder."
        )
    free = shutil.disk_usage(existing).free
    if free < SPACE:
        return (
            f"the disk of {existing} has {free / 1e6:.0f} MB left, too little for forms; free"
            f" {SPACE / 1e6:.0f} MB, or set XDG_CACHE_HOME to a folder on another disk."
        )
    return compiler_fault()


def compiler_fault() -> str | None:
    """Return why C code cannot be compiled, in one sentence; None if it can."""
    compiler = c_compiler()
    if shutil.which(compiler) is None:
        return (
            f"there is no C compiler {compiler}, which is needed to compile forms; install gcc"
            " (Debian: apt-get install gcc libc6-dev), or set CC to another compiler."
        )
    places = [sysconfig.get_path("include")]
    for name in ("CPATH", "C_INCLUDE_PATH"):
        places += filter(None, os.environ.get(name, "").split(os.pathsep))
    if not any(Path(place, "Python.h").exists() for place in places):
        return (
            f"Python.h is missing in {places[0]}, but forms need it to compile; install Python's"
            " headers (Debian: apt-get install python3-dev)."
        )
    return None


def c_compiler() -> str:
    """Return the C compiler for forms, given by ``CC`` or else by Python's configuration."""
    given = os.environ.get("CC", "").split()
    return (given or (sysconfig.get_config_var("CC") or "cc").split())[0]


def _folder(package: str) -> Path | None:
    """Return the folder from which Python would import a package; None if it is not installed."""
    try:
        found = util.find_spec(package)
    except (ImportError, ValueError):
        return None
    return Path(found.origin).resolve().parent if found and found.origin else None


def _numbers(version: str) -> list[int]:
    """Return the numbers in a version, such as [2, 34] for "2.34"."""
    return [int(part) for part in version.split(".") if part.isdigit()]


REFUSED = 2
"""Exit status of this package's own processes if their last output is an error message."""


def environment_apart() -> dict[str, str]:
    """Return an environment for an auxiliary process, without the variables of MPI launchers."""
    hidden = ("OMPI_", "PMIX_", "PRTE_", "PMI_", "MPI_", "HYDRA_")
    return {key: value for key, value in os.environ.items() if not key.startswith(hidden)}


def environment_for_gmsh(home: Path) -> dict[str, str]:
    """Return the environment of :func:`environment_apart` with another home folder, for gmsh.

    Gmsh writes settings into the home folder.

    Args:
        home: A folder that replaces the home folder.
    """
    homes = {"HOME": str(home), "XDG_CONFIG_HOME": str(home)}
    return environment_apart() | homes | {"PYTHONUSERBASE": site.getuserbase()}


def environment_with_package(environment: dict[str, str] | None = None) -> dict[str, str]:
    """Return ``environment``, or :func:`environment_apart`, with this package in PYTHONPATH."""
    environment = environment_apart() if environment is None else environment
    places = [environment.get("PYTHONPATH"), str(Path(__file__).parents[1])]
    return environment | {"PYTHONPATH": os.pathsep.join(filter(None, places))}
