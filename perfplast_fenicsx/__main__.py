"""The command line: ``perfplast run CASE.toml -o DIR`` and ``perfplast check CASE.toml``.

Exit status: 0 all load levels solved, 1 a fault of the program, 2 bad input, 3 a load level without
a solution (a result like any other: the levels before it are valid).
"""

import argparse
import io
import logging
import sys
import time
import traceback
from collections.abc import Sequence
from typing import NoReturn

from mpi4py import MPI
from petsc4py import PETSc

from dolfinx import fem

from perfplast_fenicsx import __version__
from perfplast_fenicsx.case import Case, read_case
from perfplast_fenicsx.control import WorkControl
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.limit_load import LimitLoad, limit_load
from perfplast_fenicsx.loading import load_path
from perfplast_fenicsx.output import ResultFolder, Results
from perfplast_fenicsx.plotting import dissipation, draw_fields, draw_path
from perfplast_fenicsx.problem import Problem
from perfplast_fenicsx.recovery import Recovery
from perfplast_fenicsx.state import Level
from perfplast_fenicsx.terminal import Terminal, describe
from perfplast_fenicsx.xdmf import FieldsFile

SOLVED, FAULT, BAD_INPUT, NO_SOLUTION = range(4)

PRESCRIBED = {"load": "zeta", "work": "alpha"}
"""What each control prescribes; the time of the fields' file."""

LIMIT_KEYS = ("lower", "estimate", "upper", "alpha", "levelled_off", "reason", "linear_solves")
"""Keys of ``limit`` in ``summary.json``."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line. Collective.

    Args:
        argv: Arguments; those of the process by default.

    Returns:
        The exit status, the same on every rank.
    """
    comm = MPI.COMM_WORLD
    arguments = list(sys.argv[1:] if argv is None else argv)
    for stream in (sys.stdout, sys.stderr):  # a reason may have a Greek letter in it
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    with _logging(comm):
        try:
            status = _command(comm, arguments)
        except InputError as error:
            if comm.rank == 0:
                print(f"perfplast: {error}", file=sys.stderr, flush=True)
            status = BAD_INPUT
        except SystemExit as end:  # --help and --version
            status = int(end.code or 0)
        except (Exception, KeyboardInterrupt):
            traceback.print_exc()
            sys.stderr.flush()
            if comm.size > 1:  # the others may wait for this rank
                comm.Abort(FAULT)
            return FAULT
    comm.barrier()  # a launcher may end the others as soon as one rank has ended
    return status


def run(comm: MPI.Intracomm, path: str, output: str, force: bool) -> int:
    """Solve a case and write its results. Collective.

    Args:
        comm: The ranks.
        path: Case file.
        output: Result folder.
        force: Replace results in it.

    Returns:
        :data:`SOLVED`, or :data:`NO_SOLUTION` where a level has none.

    Raises:
        InputError: If the case or the folder cannot be used.
    """
    began = time.perf_counter()
    case = read_case(path, comm)
    folder = ResultFolder(comm, output, force)
    problem = case.problem(comm)
    solver = case.solver(problem)
    folder.create()
    results = Results(folder, problem, case.title, __version__, case.method)
    timings = results.summary.timings
    timings["setup"] = time.perf_counter() - began
    terminal = Terminal(comm)
    terminal.header(case.title, case.method, problem)
    recovery = Recovery(problem)
    fields_file = FieldsFile(folder, problem.assembly.mesh) if case.output.fields else None
    last: Level | None = None

    def accept(level: Level) -> None:
        nonlocal last
        terminal.level(level.report)
        with results.timed("output"):
            if level.report.converged:
                last = level
                if fields_file is not None:
                    time_ = getattr(level.report, PRESCRIBED[solver.control])
                    fields_file.write(recovery.update(level.state), time_)
            timings["total"] = time.perf_counter() - began
            results.add(level.report)

    limit = None
    with results.timed("solve"):
        if isinstance(case.loading, WorkControl) and case.loading.limit_tolerance is not None:
            tolerance = case.loading.limit_tolerance
            limit = limit_load(problem, tolerance, solver, terminal.iteration, accept)
            terminal.limit(limit)
        else:
            for level in load_path(solver, case.loading.values or [], terminal.iteration):
                accept(level)
    timings["solve"] -= timings.get("output", 0.0)
    if limit is not None:
        with results.timed("output"):
            results.summary.limit = {key: getattr(limit, key) for key in LIMIT_KEYS}
            if case.output.fields:
                mechanism = FieldsFile(folder, problem.assembly.mesh, "mechanism.xdmf")
                mechanism.write({"mechanism": limit.mechanism}, limit.alpha)
    if case.output.pictures and last is not None:
        with results.timed("pictures"):
            _draw(case, problem, recovery, last, results, limit)
    timings["total"] = time.perf_counter() - began
    results.write()
    terminal.results(folder)
    solved = all(report.converged for report in results.reports)
    return SOLVED if solved and (limit is None or limit.levelled_off) else NO_SOLUTION


def check(comm: MPI.Intracomm, path: str) -> int:
    """Check a case, its mesh, names and contact included, without solving it. Collective.

    Raises:
        InputError: If the case cannot be used.
    """
    case = read_case(path, comm)
    text = describe(case.title, case.method, case.problem(comm))
    Terminal(comm).say(f"{text}\n{case.path} can be run.")
    return SOLVED


def _command(comm: MPI.Intracomm, arguments: list[str]) -> int:
    ours, petsc = arguments, []
    if "--" in arguments:
        split = arguments.index("--")
        ours, petsc = arguments[:split], arguments[split + 1 :]
    chosen = _parser(comm).parse_args(ours)
    set_petsc_options(petsc)
    if chosen.command == "check":
        return check(comm, chosen.case)
    return run(comm, chosen.case, chosen.output, chosen.force)


def set_petsc_options(arguments: Sequence[str]) -> None:
    """Put options such as ``-perfplast_ksp_rtol 1e-10`` into PETSc's database.

    Raises:
        InputError: If an argument is neither an option nor the value of one.
    """
    options = PETSc.Options()
    name = None
    names = []
    for argument in arguments:
        is_name = argument.startswith("-") and argument[1:2].isalpha()
        if is_name:
            name = argument[1:]
            options[name] = None
            names.append(name)
        elif name is not None:
            options[name] = argument
            name = None
        else:
            raise InputError(
                f"after '--' stands '{argument}', which is neither a PETSc option nor its value;"
                " write for instance -- -perfplast_ksp_rtol 1e-10."
            )
    for name in names:  # the solvers copy what has their prefix; PETSc warns of unused copies
        if name.startswith("perfplast_"):
            options.hasName(name)


def _draw(
    case: Case,
    problem: Problem,
    recovery: Recovery,
    last: Level,
    results: Results,
    limit: LimitLoad | None,
) -> None:
    folder = results.folder

    def draw(fields: dict[str, fem.Function], name: str, caption: str | None = None) -> None:
        about = (last.report, case.title, case.loads, case.contacts)
        path = folder.file(name)
        draw_fields(problem.assembly, fields, *about, path, caption, case.obstacles)

    fields = recovery.update(last.state)
    draw(fields, "fields.png")
    if limit is not None:
        caption = f"collapse mechanism at ζ = {limit.lower:.6g}, velocity of unit work"
        work = dissipation(problem, limit.mechanism)
        mechanism = fields | {"displacement": limit.mechanism, "dissipation": work}
        draw(mechanism, "mechanism.png", caption)
    path = folder.file("path.png")
    folder.on_root(lambda: draw_path(results.reports, case.title, path, limit))


class _Parser(argparse.ArgumentParser):
    """Speaks on rank 0 only, and raises InputError instead of printing its usage."""

    comm: MPI.Intracomm = MPI.COMM_WORLD

    def error(self, message: str) -> NoReturn:
        raise InputError(f"{message}; see {self.prog} --help.")

    def _print_message(self, message: str, file: object = None) -> None:
        if self.comm.rank == 0:
            super()._print_message(message, file)  # type: ignore[arg-type]


def _parser(comm: MPI.Intracomm) -> argparse.ArgumentParser:
    parser = _Parser(
        prog="perfplast",
        description="Elastic-perfectly plastic bodies in frictionless contact.",
        epilog="Exit status: 0 all load levels solved, 1 a fault of the program, 2 bad input,"
        " 3 a load level without a solution (the levels before it are valid).",
    )
    parser.comm = comm
    parser.add_argument("--version", action="version", version=f"perfplast {__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="run | check")
    run_ = commands.add_parser(
        "run",
        help="solve a case",
        description="Solve a case on any number of ranks, e.g. mpirun -n 2 perfplast run ...",
        epilog="PETSc options follow two dashes: -- -perfplast_ksp_rtol 1e-10 for the linear"
        " solver, -perfplast_vi_... for the contact set.",
    )
    run_.add_argument("case", metavar="CASE.toml", help="what to solve")
    run_.add_argument("-o", "--output", metavar="DIR", required=True, help="folder for results")
    run_.add_argument("--force", action="store_true", help="replace results in DIR")
    check_ = commands.add_parser(
        "check", help="check a case, its mesh and names included, without solving it"
    )
    check_.add_argument("case", metavar="CASE.toml", help="what to check")
    return parser


class _logging:
    """The library's warnings on standard error, from rank 0, while a command runs."""

    def __init__(self, comm: MPI.Intracomm) -> None:
        self._logger = logging.getLogger("perfplast_fenicsx")
        self._handler = logging.StreamHandler()
        self._handler.setFormatter(logging.Formatter("perfplast: %(levelname)s: %(message)s"))
        self._handler.addFilter(lambda record: comm.rank == 0)

    def __enter__(self) -> None:
        self._logger.addHandler(self._handler)

    def __exit__(self, *_: object) -> None:
        self._logger.removeHandler(self._handler)


if __name__ == "__main__":
    sys.exit(main())
