"""The command line: ``perfplast run CASE.toml -o DIR`` and ``perfplast check CASE.toml``.

Exit status: 0 all load levels solved, 1 a fault of the program, 2 bad input, 3 a load level without
a solution (a result like any other: the levels before it are valid).
"""

import argparse
import io
import logging
import sys
import traceback
from collections.abc import Sequence
from typing import NoReturn

from mpi4py import MPI
from petsc4py import PETSc

from perfplast_fenicsx import __version__
from perfplast_fenicsx.case import read_case
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.run import BAD_INPUT, FAULT, SOLVED, run
from perfplast_fenicsx.terminal import Terminal, describe


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
