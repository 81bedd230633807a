"""Check the environment and start the MPI ranks before a command is executed.

No import in this module starts MPI before the environment is checked.
"""

import argparse
import os
import shutil
import subprocess
import sys
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

from perfplast_fenicsx import environment
from perfplast_fenicsx.environment import WHEEL, environment_apart, version_of

COMPILING = ("run", "sweep", "check")
"""Commands that compile forms."""

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")
"""Environment variables that are set to one thread by default, because ranks run in parallel."""

OVERSUBSCRIBE = "PRTE_MCA_rmaps_default_mapping_policy"
"""Environment variable; ":oversubscribe" lets Open MPI 5 start more ranks than cores."""


def prepare(chosen: argparse.Namespace, arguments: Sequence[str]) -> str | None:
    """Return a sentence that explains why a command cannot be executed; None if it can.

    If the user gives a number of ranks above 1, the launcher replaces this process.

    Args:
        chosen: The command and its arguments, from :func:`~.parser.read_arguments`.
        arguments: The arguments as the user gave them.
    """
    fault = environment.surroundings().fault()
    if fault is None and chosen.command in COMPILING:
        # without a compiler, the existing compiled forms may suffice
        compiled = any(environment.forms_folder().glob("*.so"))
        fault = None if compiled else environment.forms_fault()
    if fault is not None:
        return fault
    for name in THREADS:
        os.environ.setdefault(name, "1")
    launched = launched_ranks(os.environ)
    wanted = getattr(chosen, "ranks", None)
    if wanted is not None and wanted < 1:
        return f"-n {wanted} is less than 1; give a number of ranks, for example -n 2."
    if launched is not None:
        return _launcher_fault(wanted, *launched)
    if wanted is None or wanted == 1:
        return None
    try:
        launcher = find_launcher()
    except (LookupError, subprocess.TimeoutExpired) as error:
        return str(error)
    _start(launcher, wanted, arguments)


def launched_first() -> bool:
    """Return whether this process has rank 0, or was started without a launcher."""
    launched = launched_ranks(os.environ)
    return launched is None or launched[1] == 0


@dataclass(frozen=True)
class Launcher:
    """A program that starts the ranks of a run.

    Attributes:
        program: Path of the program.
        family: "MPICH" or "Open MPI".
        version: Version of the MPI.
    """

    program: str
    family: str
    version: str

    def __str__(self) -> str:
        """Return path, family and version."""
        return f"{self.program} ({self.family} {self.version})"


def find_launcher() -> Launcher:
    """Return the ``mpirun`` of the MPI that mpi4py uses.

    Raises:
        LookupError: If the program is not installed; the message is one sentence with a remedy.
    """
    family = mpi_family()
    beside = Path(sys.executable).parent
    others = []
    for name in ("mpirun", "mpiexec", "mpirun.openmpi", "mpirun.mpich"):
        for program in (beside / name, shutil.which(name)):
            if program is None or not os.access(program, os.X_OK):
                continue
            launcher = _launcher(str(program))
            if launcher is not None and launcher.family == family:
                return launcher
            others.append(f"{program} is {launcher.family}'s" if launcher else str(program))
    package = {"MPICH": "mpich", "Open MPI": "openmpi-bin"}.get(family, family)
    found = f"; {others[0]}" if others else ""
    raise LookupError(
        f"there is no mpirun of {family}, which mpi4py uses{found}; install it (Debian's or PyPI's "
        f"package {package}), or run on one rank."
    )


def mpi_family() -> str:
    """Return the name of the MPI that mpi4py uses, such as "MPICH" or "Open MPI"."""
    if version_of(WHEEL):
        return "MPICH"
    question = "from mpi4py import MPI; print(MPI.get_vendor()[0])"
    done = subprocess.run(
        [sys.executable, "-c", question],
        env=environment_apart(),
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    if done.returncode:
        last = (done.stderr.strip().splitlines() or ["no reason given"])[-1]
        raise LookupError(f"mpi4py cannot start MPI ({last}); reinstall mpi4py and its MPI.")
    return done.stdout.strip()


def launched_ranks(environ: Mapping[str, str]) -> tuple[str, int, int] | None:
    """Return the MPI family, rank and number of ranks; None if no launcher started the process.

    Args:
        environ: The environment variables of the process.
    """
    for family, rank, size in (
        ("Open MPI", "OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE"),
        ("MPICH", "PMI_RANK", "PMI_SIZE"),
    ):
        if environ.get(size, "").isdigit():
            return family, int(environ.get(rank) or 0), int(environ[size])
    return None


def _launcher(program: str) -> Launcher | None:
    """Return a launcher with its MPI family and version; None for other programs."""
    try:
        done = subprocess.run(
            [program, "--version"],
            env=environment_apart(),
            capture_output=True,
            text=True,
            timeout=30,
        )
    except (OSError, subprocess.TimeoutExpired):
        return None
    words = done.stdout.split()
    if "HYDRA" in words:
        number = words[words.index("Version:") + 1] if "Version:" in words else "of unknown version"
        return Launcher(program, "MPICH", number)
    if "(Open MPI)" in done.stdout:
        return Launcher(program, "Open MPI", words[words.index("MPI)") + 1])
    return None


def _start(launcher: Launcher, ranks: int, arguments: Sequence[str]) -> NoReturn:
    """Replace this process by the launcher, which starts the ranks."""
    print(f"perfplast: {ranks} ranks started by {launcher}", file=sys.stderr, flush=True)
    os.environ.setdefault(OVERSUBSCRIBE, ":oversubscribe")
    program = [sys.executable, "-P", "-m", "perfplast_fenicsx", *arguments]
    os.execv(launcher.program, [launcher.program, "-n", str(ranks), *program])


def _launcher_fault(wanted: int | None, family: str, rank: int, number: int) -> str | None:
    """Return a sentence if the ranks are not connected or if their number is wrong; else None."""
    if wanted is not None and wanted != number:
        return f"-n {wanted} is given inside mpirun -n {number}; remove one of them."
    if number == 1:
        return None
    # without this filter, mpi4py prints a warning of three lines in each process
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        from mpi4py import MPI

    if MPI.COMM_WORLD.size == number:
        return None
    ours = MPI.get_vendor()[0]
    return (
        f"mpirun of {family} has started {number} processes, but mpi4py uses {ours} and "
        f"treats each as a separate run; use perfplast run -n {number}, which finds the "
        "right mpirun."
    )
