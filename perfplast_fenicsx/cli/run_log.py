"""Send log messages to standard error and ``run.log``, and describe the environment of a run.

The library logs under the name of the package and configures no logging. All handlers are in this
module, which only the command line uses. Only rank 0 logs.
"""

import dataclasses
import logging
import os
import platform
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib import metadata
from types import TracebackType

from mpi4py import MPI
from petsc4py import PETSc

import dolfinx
import numpy as np
from threadpoolctl import threadpool_info

from perfplast_fenicsx._version import __version__
from perfplast_fenicsx.arrays import Longs
from perfplast_fenicsx.cli.parser import LOG_LEVELS
from perfplast_fenicsx.errors import InputError, code_of_record, raise_together, visible
from perfplast_fenicsx.extensions import extensions
from perfplast_fenicsx.io.case.case import Case
from perfplast_fenicsx.io.results.result_files import BEGUN, ENDED, hold
from perfplast_fenicsx.io.results.result_folder import ResultFolder
from perfplast_fenicsx.limit_analysis.body.adaptive_meshes import Round
from perfplast_fenicsx.limit_analysis.body.body_bounds import BodyBounds
from perfplast_fenicsx.limit_analysis.discrete.discrete_limit import InteriorStep
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitLoad
from perfplast_fenicsx.problem.judged.report import Iteration, LevelReport

log = logging.getLogger(__name__)


LIBRARIES = {
    "basix": "fenics-basix",
    "FFCx": "fenics-ffcx",
    "UFL": "fenics-ufl",
    "mpi4py": "mpi4py",
    "numpy": "numpy",
    "scipy": "scipy",
    "h5py": "h5py",
    "gmsh": "gmsh",
    "matplotlib": "matplotlib",
    "pyvista": "pyvista",
}
"""Distribution names of Python libraries, by the common names of the libraries."""

PETSC_PACKAGES = ("mumps", "hypre", "superlu_dist", "ptscotch", "parmetis", "ml", "cuda", "hip")
"""Solvers, partitioners and devices that PETSc may have been built with."""


def versions() -> dict[str, str]:
    """Return the versions by library name, important ones first; "none" for missing libraries."""
    found = {
        "perfplast": __version__,
        "DOLFINx": dolfinx.__version__,
        "PETSc": ".".join(map(str, PETSc.Sys.getVersion())),
    }
    for name, distribution in LIBRARIES.items():
        try:
            found[name] = metadata.version(distribution)
        except metadata.PackageNotFoundError:
            found[name] = "none"
    found["extensions"] = extensions()
    found["Python"] = platform.python_version()
    found["MPI"] = MPI.Get_library_version().split(",")[0].split("\n")[0].strip("\0 ")
    return found


def petsc_packages() -> list[str]:
    """Return those :data:`PETSC_PACKAGES` with which PETSc was built."""
    return [name for name in PETSC_PACKAGES if PETSc.Sys.hasExternalPackage(name)]


def petsc_options() -> str:
    """Return the options in PETSc's database as they would be given on a command line."""
    options = PETSc.Options().getAll()
    return " ".join(f"-{key} {options[key]}" for key in options)


def blas() -> str:
    """Return the loaded BLAS libraries in words, each with its version and number of threads."""
    found = (
        f"{library['filepath']} ({library['internal_api']} {library['version']},"
        f" {library['num_threads']} threads)"
        for library in threadpool_info()
        if library["user_api"] == "blas"
    )
    return ", ".join(sorted(found)) or "unknown"


def threads() -> str:
    """Return the number of cores that this process may use, and its thread limits, in words."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    # Environment variables that set the number of threads.
    variables = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS")
    limits = [f"{name}={os.environ[name]}" for name in variables if name in os.environ]
    return (
        f"{cores} core{'s' if cores != 1 else ''} a rank, {' '.join(limits) or 'no limit is set'}"
    )


def ranks(comm: MPI.Intracomm) -> str:
    """Return the number of ranks on each host, in words. Collective."""
    hosts = comm.allgather(MPI.Get_processor_name())
    counts: Longs
    names, counts = np.unique(hosts, return_counts=True)
    return ", ".join(f"{n} on {host}" for host, n in zip(names, counts, strict=True))


def surroundings(comm: MPI.Intracomm) -> dict[str, str]:
    """Return the data of the machine and of PETSc, in words by name. Collective."""
    return {
        "PETSc packages": ", ".join(petsc_packages()) or "none",
        "PETSc scalars": f"{np.dtype(PETSc.ScalarType)}, indices {np.dtype(PETSc.IntType)}",
        "BLAS": blas(),
        "ranks": ranks(comm),
        "threads": threads(),
        "system": platform.platform(),
    }


@contextmanager
def logged_to_console(
    comm: MPI.Intracomm, level: str = "warning", before: Callable[[], None] | None = None
) -> Iterator[None]:
    """Show the package's log records on standard error, from rank 0 only, in a ``with`` block.

    Args:
        comm: The ranks of the run.
        level: The lowest level that is shown, from :data:`~.parser.LOG_LEVELS`.
        before: Function that is called before each record; it clears the live line.
    """

    class Handler(logging.StreamHandler):
        def emit(self, record: logging.LogRecord) -> None:
            if before is not None:
                before()
            super().emit(record)

    handler = Handler()
    handler.setFormatter(_Visible("perfplast: %(levelname)s: %(message)s"))
    with _handled(comm, handler, level):
        yield


class RunLog:
    """The file ``run.log``: time stamps, versions, options, Newton steps, warnings, and the end.

    The class is a context manager: it logs an exception that ends the block, with its traceback. A
    continued run appends its log to the existing file.
    """

    def __init__(self, folder: ResultFolder, level: str = "info", first: int = 1) -> None:
        """Open the file. Collective.

        Args:
            folder: Result folder that contains the file.
            level: Lowest level that is logged, if it is lower than "info".
            first: Number of the first load level of this run; larger than 1 in a continued run.

        Raises:
            InputError: If the file cannot be written.
        """
        self._comm = folder.comm
        self._number = first
        self._began = time.perf_counter()
        fault = None
        handler: logging.Handler = logging.NullHandler()
        if self._comm.rank == 0:
            path = folder.file("run.log")
            try:
                handler = _LogFile(path, encoding="utf-8", delay=False)
                hold(handler.stream)
            except OSError as error:
                fault = f"'{path}' cannot be written ({error.strerror}); give another folder."
        raise_together(self._comm, fault)
        handler.setFormatter(_Visible("%(asctime)s %(levelname)-7s %(message)s"))
        least = min(level, "info", key=LOG_LEVELS.index)
        self._handled = _handled(self._comm, handler, least)

    def __enter__(self) -> "RunLog":
        self._handled.__enter__()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if isinstance(error, InputError):  # the command line prints the message
            log.info("ended: %s", error)
        elif isinstance(error, KeyboardInterrupt):
            log.info("ended immediately by a signal")
        elif error is not None:
            text = "".join(traceback.format_exception(error)).rstrip()
            log.error("ended by %s\n%s", type(error).__name__, text)
        log.info("%s %.1f s", ENDED, time.perf_counter() - self._began)
        self._handled.__exit__(None, None, None)

    def header(self, case: Case, descriptions: Sequence[str]) -> None:
        """Log the case, the versions and the machine. Collective.

        Args:
            case: The case that is solved.
            descriptions: Lines that describe the discrete problem and how its contacts were formed.
        """
        log.info("%s", ", ".join(f"{name} {version}" for name, version in versions().items()))
        for name, text in surroundings(self._comm).items():
            log.info("%s: %s", name, text)
        for field in filter(lambda field: field.repr, dataclasses.fields(case)):
            log.info("case.%s: %s", field.name, getattr(case, field.name))
        log.info("%s %s", BEGUN, petsc_options())
        for description in descriptions:
            log.info("%s", description)

    def iteration(self, record: Iteration) -> None:
        """Log a Newton step; called by the algorithms."""
        log.info(
            "level %d, step %d: zeta %.10g, alpha %.10g, increment %.2e, beta %.3g, rho "
            "%.1e, %.2f%% plastic, %d contacts, %d solves for them, %d linear iterations, "
            "%.2f s",
            *(self._number, record.number, record.zeta, record.alpha, record.increment),
            *(record.beta, record.rho, 100 * record.plastic_fraction, record.active_contacts),
            *(record.active_set_iterations, record.linear_iterations, record.seconds),
        )

    def interior(self, step: InteriorStep) -> None:
        """Log a step of the interior point method; called after each step."""
        log.info(
            "step %d: load %.10g, gap %.2e, unbalanced forces %.2e, inadmissible flow "
            "%.2e, length %.3g, %.2f s",
            *(step.number, step.load, step.gap, step.unbalanced, step.inadmissible),
            *(step.length, step.seconds),
        )

    def mesh(self, round_: Round) -> None:
        """Log the bounds from one of several meshes; called as a monitor after each mesh."""
        log.info("%s", round_)

    def say(self, words: str) -> None:
        """Log a sentence."""
        log.info("%s", words)

    def level(self, report: LevelReport) -> None:
        """Log the end of a level."""
        told = "solved" if report.converged else "NO SOLUTION"
        contact = ""
        if report.contact_programs:
            contact = (
                f", {report.snes_vi_programs} of {report.contact_programs} contact programs by"
                f" SNES-VI in {report.snes_vi_iterations} iterations"
            )
        log.info(
            "level %d: %s (%s): zeta %.10g, alpha %.10g, duality gap %.1e, equilibrium %.1e,"
            " %d linear solves, %d set-ups%s, %.2f s",
            *(self._number, told, report.reason, report.zeta, report.alpha, report.duality_gap),
            *(report.equilibrium, report.linear_solves, report.setups, contact, report.seconds),
        )
        self._number += 1

    def limit(self, limit: LimitLoad, body: BodyBounds | None) -> None:
        """Log the result of the search for the limit load."""
        log.info("%s", limit)
        if body is not None:
            log.info("%s", body)


class _Visible(logging.Formatter):
    """A formatter that escapes control characters, because users read logs on terminals."""

    def format(self, record: logging.LogRecord) -> str:
        """Return the text of a record, in one or several lines."""
        return visible(super().format(record), lines=True)


class _LogFile(logging.FileHandler):
    """A handler that ignores write errors, which the writer of the results reports."""

    def handleError(self, record: logging.LogRecord) -> None:
        """Ignore the record that could not be written."""

    def close(self) -> None:
        """Close the file and ignore errors."""
        with suppress(OSError):
            super().close()


@contextmanager
def kept_warnings(comm: MPI.Intracomm) -> Iterator[list[str]]:
    """Collect the package's warnings on rank 0 in a list, which grows within the block."""
    kept: list[str] = []

    class Handler(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            if record.levelno == logging.WARNING:
                kept.append(record.getMessage())

    with _handled(comm, Handler(), "warning"):
        yield kept


@contextmanager
def coded_warnings(comm: MPI.Intracomm, kept: list[dict[str, str]]) -> Iterator[None]:
    """Append the code and message of each warning of the package to a list on rank 0."""

    class Handler(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            kept.append({"code": code_of_record(record), "message": record.getMessage()})

    with _handled(comm, Handler(), "warning"):
        yield


class _Once(logging.Filter):
    """A filter that passes each warning once, because every finer mesh repeats the warnings."""

    def __init__(self) -> None:
        super().__init__()
        self._seen = set[str]()

    def filter(self, record: logging.LogRecord) -> bool:
        """Return whether a record is no warning, or a warning with a new text."""
        if record.levelno != logging.WARNING:
            return True
        text = record.getMessage()
        new = text not in self._seen
        self._seen.add(text)
        return new


@contextmanager
def _handled(comm: MPI.Intracomm, handler: logging.Handler, level: str) -> Iterator[None]:
    """Send the package's log records from rank 0 to a handler, from a level upwards."""
    handler.setLevel(level.upper())
    handler.addFilter(lambda record: comm.rank == 0)
    handler.addFilter(_Once())
    package = logging.getLogger("perfplast_fenicsx")
    before = package.level
    package.setLevel(min(before or logging.WARNING, handler.level))
    package.addHandler(handler)
    try:
        yield
    finally:
        package.removeHandler(handler)
        package.setLevel(before)
        handler.close()
