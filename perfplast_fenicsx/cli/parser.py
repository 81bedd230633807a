"""Parse the arguments of the command line, and the PETSc options after them.

Exit status: 0 all load levels solved, 1 a fault of the program, 2 bad input, 3 a load level without
a solution (the levels before it are valid).

This module imports MPI, PETSc and DOLFINx only where they are needed. Importing them takes a
second, but help, version and shell completion must be fast.
"""

import argparse
import os
from collections.abc import Mapping, Sequence
from typing import Any, NoReturn

from perfplast_fenicsx._version import __version__
from perfplast_fenicsx.cli.json_answer import FIELDS, OPTION
from perfplast_fenicsx.errors import InputError, nearest
from perfplast_fenicsx.io.case.code_templates import TEMPLATES
from perfplast_fenicsx.materials.common import TABLE
from perfplast_fenicsx.units import SYSTEMS


def add_mesh(commands: Any, scripts: argparse.ArgumentParser) -> None:
    """Add the command ``mesh``.

    Args:
        commands: The sub-parsers.
        scripts: Parser with the arguments of all commands that may run a script.
    """
    mesh = commands.add_parser(
        "mesh",
        parents=[scripts],
        help="turn a geometry, or a model of another program, into a mesh and a first case file",
        description="Read the bodies of a geometry file, find where they touch, and write "
        "DIR/case.msh and DIR/case.toml, in which you fill in materials, supports and "
        "loads. Lengths are in mm for STEP files. A model of another program (Abaqus, "
        "CalculiX: .inp; Salome: .med; I-DEAS: .unv; Nastran: .bdf; VTK: .vtu) already "
        "has a mesh: the command takes the mesh with its groups, and from an .inp file "
        "also materials, supports, loads, contacts and ties.",
    )
    mesh.add_argument(
        "geometry",
        metavar="DRAWING",
        help=".step, .stp, .brep, .iges, .igs, .geo; .inp, .med, .unv, .bdf, .nas, .fem, .vtu or"
        " .vtk",
    )
    mesh.add_argument("-o", "--output", metavar="DIR", required=True, help="output folder")
    mesh.add_argument("--force", action="store_true", help="replace mesh and case file in DIR")
    _add_sizes(mesh)
    _add_bodies(mesh)


def _add_sizes(mesh: argparse.ArgumentParser) -> None:
    """Add the options of the cells."""
    mesh.add_argument("--size", metavar="H", type=float, help="largest edge length")
    mesh.add_argument(
        "--size-of",
        metavar="BODY=H",
        action="append",
        default=[],
        help="largest edge length in one body (may be repeated)",
    )
    mesh.add_argument(
        "--curvature",
        metavar="N",
        type=float,
        help="number of elements around a circle (default: 10, or as many as make areas "
        "accurate to 1 %%)",
    )
    mesh.add_argument(
        "--order", type=int, choices=(1, 2), default=1, help="2 for curved elements (default: 1)"
    )
    mesh.add_argument(
        "--patience",
        metavar="S",
        type=float,
        default=600.0,
        help="largest time for meshing, in seconds (default: 600)",
    )


def _add_bodies(mesh: argparse.ArgumentParser) -> None:
    """Add the options of the bodies, and of their joints."""
    mesh.add_argument(
        "--without",
        metavar="BODY",
        action="append",
        default=[],
        help="body to leave out, by its name (may be repeated)",
    )
    mesh.add_argument(
        "--symmetry",
        metavar="AXIS=X",
        action="append",
        default=[],
        help="plane of symmetry, such as x=0; the half with positive coordinates is kept (may "
        "be repeated)",
    )
    mesh.add_argument(
        "--apart",
        action="store_true",
        help="mesh each body separately; contact is then mortar, even where bodies share a "
        "face in the drawing",
    )
    mesh.add_argument(
        "--overlap",
        metavar="SHARE",
        type=float,
        default=1e-3,
        help="largest share of a body's volume that another body may overlap (default: 0.001)",
    )
    mesh.add_argument(
        "--close-gaps",
        metavar="GAP",
        type=float,
        default=0.0,
        help="largest distance at which faces of bodies still touch (default: 0)",
    )
    mesh.add_argument(
        "--material",
        metavar="NAME",
        help="material of all bodies (perfplast materials lists the names)",
    )
    glued = mesh.add_mutually_exclusive_group()
    glued.add_argument(
        "--glued", "--tied", dest="tied", action="store_true", help="glue bodies that touch"
    )
    glued.add_argument("--bolted", action="store_true", help="glue only bolts to their nuts")


ENDINGS = {
    "CASE.toml": ("toml",),
    "DRAWING": (
        *("step", "stp", "brep", "iges", "igs", "geo"),
        *("inp", "med", "unv", "bdf", "nas", "fem", "vtu", "vtk"),
    ),
    "FILE": ("gif", "webp"),
    "PAGE": ("html",),
    "SCHEMA": ("json",),
}
"""Suffixes of the files that arguments name, by metavar."""


def complete(parser: argparse.ArgumentParser, **settings: Any) -> None:
    """Answer a completion request of the shell and end the process; otherwise do nothing.

    Args:
        parser: Parser of all commands.
        settings: Arguments of ``argcomplete.autocomplete``, for tests.
    """
    if "_ARGCOMPLETE" not in os.environ:
        return
    try:
        import argcomplete
        from argcomplete.completers import DirectoriesCompleter, FilesCompleter
    except ImportError:
        return
    folders = ("DIR", "FOLDER")  # metavars of arguments that name folders
    for action in _actions(parser):
        if action.metavar in folders:
            vars(action)["completer"] = DirectoriesCompleter()
        elif isinstance(action.metavar, str) and action.metavar in ENDINGS:
            vars(action)["completer"] = FilesCompleter(ENDINGS[action.metavar])
    argcomplete.autocomplete(parser, **settings)


def _actions(parser: argparse.ArgumentParser) -> list[argparse.Action]:
    """Return the actions of the parser and of its commands."""
    found = list(parser._actions)
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            found += [deeper for command in action.choices.values() for deeper in _actions(command)]
    return found


SOLVED, FAULT, BAD_INPUT, NO_SOLUTION = range(4)
"""Exit statuses of the command line; for an interrupted run 128 plus the signal's number."""

LOG_LEVELS = ("debug", "info", "warning", "error")

RANKS = ("OMPI_COMM_WORLD_RANK", "PMI_RANK", "PMIX_RANK", "SLURM_PROCID")
"""Environment variables in which launchers give a process its rank."""


def read_arguments(arguments: Sequence[str]) -> argparse.Namespace:
    """Return the command and its arguments. Not collective.

    Args:
        arguments: The arguments without the name of the program.

    Returns:
        The values by name; ``petsc`` are the arguments after two dashes, for
        :func:`set_petsc_options`.

    Raises:
        InputError: If the arguments are not valid.
        SystemExit: After help or version.
    """
    for argument in arguments:
        if not argument.isprintable() and any("\udc80" <= c <= "\udcff" for c in argument):
            raise InputError(f"the argument '{argument}' is not UTF-8; give it another name.")
    ours, petsc = list(arguments), []
    if "--" in ours:
        split = ours.index("--")
        ours, petsc = ours[:split], ours[split + 1 :]
    parser = make_parser()
    complete(parser)
    chosen, unknown = parser.parse_known_args(ours)
    if unknown:
        known = [name for name in parser.options(chosen.command) if name.startswith("--")]
        first, remedy = unknown[0], nearest(unknown[0], known)
        raise InputError(f"perfplast {chosen.command} has no argument '{first}'; {remedy}")
    solving = ("run", "sweep", "check")  # commands that accept PETSc options
    if petsc and chosen.command not in solving:
        raise InputError(f"perfplast {chosen.command} takes no PETSc options; remove '--'.")
    if chosen.command in ("run", "sweep") and chosen.restart and chosen.force:
        raise InputError(
            "--restart continues from results, but --force replaces them; give one of them."
        )
    if chosen.command == "run" and chosen.restart and chosen.refine:
        raise InputError("--restart continues one run, but --refine starts two; give one of them.")
    if chosen.command == "plot" and not chosen.wait >= 0:  # NaN is not a valid time either
        raise InputError(f"--wait must be a time of 0 s or more, not {chosen.wait:g}.")
    chosen.petsc = petsc
    return chosen


def set_petsc_options(arguments: Sequence[str]) -> None:
    """Put options such as ``-perfplast_ksp_rtol 1e-10`` into PETSc's database.

    Raises:
        InputError: If an argument is neither an option nor its value, or if an option is unknown or
            has a wrong value.
    """
    from petsc4py import PETSc

    from perfplast_fenicsx.solvers.linear.petsc_options import check_options

    options = PETSc.Options()
    name = None
    given: dict[str, str | None] = {}
    for argument in arguments:
        is_name = argument.startswith("-") and argument[1:2].isalpha()
        if is_name:
            name = argument[1:]
            given[name] = None
        elif name is not None:
            given[name] = argument
            name = None
        else:
            raise InputError(
                f"after '--' there is '{argument}', which is neither a PETSc option nor "
                "its value; write for instance -- -perfplast_ksp_rtol 1e-10."
            )
    check_options(given)
    for name, value in given.items():
        options[name] = value
    for (
        name
    ) in given:  # the solvers copy the options with their prefix; PETSc would warn of unused copies
        if name.startswith("perfplast_"):
            options.hasName(name)


class _Parser(argparse.ArgumentParser):
    """A parser that prints only on rank 0, and raises InputError instead of printing its usage."""

    commands: Mapping[str, argparse.ArgumentParser]

    def options(self, command: str) -> list[str]:
        """Return the names of the options of a command."""
        return list(self.commands[command]._option_string_actions)

    def error(self, message: str) -> NoReturn:
        raise InputError(f"{message}; see {self.prog} --help.")

    def _print_message(self, message: str, file: object = None) -> None:
        rank = next((os.environ[name] for name in RANKS if name in os.environ), "0")
        if rank == "0":
            super()._print_message(message, file)  # type: ignore[arg-type]


def _add_results(command: argparse.ArgumentParser) -> None:
    """Add the arguments for the case and the folder of its results."""
    command.add_argument("case", metavar="CASE.toml", help="the case to solve")
    where = command.add_mutually_exclusive_group(required=True)
    where.add_argument("-o", "--output", metavar="DIR", help="result folder")
    where.add_argument(
        "--restart", metavar="DIR", help="continue from the last solved level in this folder"
    )
    command.add_argument(
        "-n",
        "--ranks",
        metavar="N",
        type=int,
        help="number of ranks to start, with the mpirun of the MPI in use",
    )
    command.add_argument("--force", action="store_true", help="replace results in DIR")
    pages = command.add_mutually_exclusive_group()
    pages.add_argument("--report", action="store_true", help="write DIR/report.html at the end")
    pages.add_argument(
        "--watch",
        action="store_true",
        help="write DIR/report.html at the end, and keep it current until then; a browser shows the"
        " progress at each reload",
    )
    command.add_argument(
        "--log-level",
        choices=LOG_LEVELS,
        default="warning",
        help="show messages of at least this level on standard error; info shows every Newton "
        "step (DIR/run.log always has them; default: warning)",
    )
    command.add_argument(
        "--quiet",
        action="store_true",
        help="print nothing on standard output; warnings still appear",
    )


def make_parser() -> _Parser:
    """Return the parser of all commands."""
    parser = _Parser(
        prog="perfplast",
        description="Compute elastic-plastic bodies in contact, and the loads at "
        "which they collapse.",
        epilog="Exit status: 0 all load levels solved, 1 a fault of the program, 2 bad input, 3 "
        "a load level without a solution (the levels before it are valid), 130 or 143 "
        "interrupted (--restart continues).",
    )
    parser.add_argument("--version", action="version", version=f"perfplast {__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    scripts = _Parser(add_help=False)
    scripts.add_argument(
        "--trust",
        action="store_true",
        help="run a .geo script, which may run any command: use it only for scripts whose "
        "contents you know",
    )
    parser.commands = commands.choices
    _add_solving(commands, scripts)
    add_mesh(commands, scripts)
    _add_setup(commands)
    _add_check(commands, scripts)
    _add_pictures(commands)
    _add_pages(commands)
    _add_references(commands, scripts)
    for name, command in commands.choices.items():
        if name in FIELDS:
            command.add_argument(
                OPTION,
                action="store_true",
                help="print one JSON object on standard output, and the lines on standard error",
            )
    return parser


def _add_solving(commands: Any, scripts: argparse.ArgumentParser) -> None:
    """Add the commands that solve.

    Args:
        commands: Sub-parsers.
        scripts: Options of all commands that may run a script.
    """
    run = commands.add_parser(
        "run",
        parents=[scripts],
        help="solve a case",
        description="Solve a case on any number of ranks, e.g. perfplast run -n 2 ...",
        epilog="PETSc options follow two dashes: -- -perfplast_ksp_rtol 1e-10 for the linear "
        "solver, -perfplast_vi_... for the contact set.",
    )
    _add_results(run)
    run.add_argument(
        "--refine",
        action="store_true",
        help="solve the case again with elements of half the size, in DIR/half, and compare "
        "both in a table",
    )

    sweep = commands.add_parser(
        "sweep",
        parents=[scripts],
        help="solve a case with other values, and collect all results in one table",
        description="Solve a case once for each value, or each combination of values, in separate "
        "folders DIR/0001 and so on; DIR/sweep.csv and DIR/sweep.png contain all results.",
    )
    _add_results(sweep)
    sweep.add_argument(
        "--vary",
        metavar="KEY=VALUES",
        action="append",
        required=True,
        help="a key of the case with values FROM:TO:NUMBER or A,B,C, as in "
        "material.block.yield_stress=200:300:5 or load.top.pressure=1,2; may be repeated",
    )


def _add_setup(commands: Any) -> None:
    """Add ``setup``; see :func:`_add_solving` for the arguments."""
    setup = commands.add_parser(
        "setup",
        help="open the page on which a case is set up by clicks",
        description="Open DIR/setup.html, which perfplast mesh has written, in a browser. Without a"
        " screen, print its address.",
    )
    setup.add_argument("folder", metavar="DIR", help="folder that perfplast mesh has written")


def _add_check(commands: Any, scripts: argparse.ArgumentParser) -> None:
    """Add ``check``; see :func:`_add_solving` for the arguments."""
    check = commands.add_parser(
        "check",
        parents=[scripts],
        help="print and draw how the program reads a case, and refuse it where run would, "
        "without solving it",
        description="Make every test that run makes before its first solve, except for memory. "
        "Print what each load and each support covers, which faces touch and which are free, "
        "and draw them.",
    )
    check.add_argument("case", metavar="CASE.toml", help="the case to check")
    check.add_argument(
        "-o",
        "--output",
        metavar="PICTURE",
        help="PNG file for the picture (default: case.png next to CASE.toml; none with "
        "pictures = false under [output])",
    )


def _add_pictures(commands: Any) -> None:
    """Add the commands that draw results."""
    plot = commands.add_parser(
        "plot",
        help="draw loading curve, plastic zone, mechanism and contact pressure",
        description="Draw path.png, fields.png and mechanism.png of a run, which may still be in "
        "progress. One process draws, whatever the number of ranks.",
    )
    plot.add_argument("results", metavar="DIR", help="result folder of perfplast run")
    plot.add_argument(
        "-o", "--output", metavar="FOLDER", help="folder for the pictures (default: DIR)"
    )
    plot.add_argument(
        "--follow",
        action="store_true",
        help="show and draw levels as they are solved, with the remaining ones, until the run ends",
    )
    plot.add_argument(
        "--wait",
        metavar="SECONDS",
        type=float,
        default=60.0,
        help="time to wait for the first results of a followed run (default: 60)",
    )

    animate = commands.add_parser(
        "animate",
        help="show the loading as an animation",
        description="Show plastic zone, contact pressure and loading curve of a run level by level."
        " One process draws, whatever the number of ranks.",
    )
    animate.add_argument("results", metavar="DIR", help="result folder of perfplast run")
    animate.add_argument(
        "-o",
        "--output",
        metavar="FILE",
        help="file ending in .gif or .webp (default: DIR/loading.gif)",
    )


def _add_pages(commands: Any) -> None:
    """Add the commands that write results for others."""
    report = commands.add_parser(
        "report",
        help="write a report as one HTML page for any browser",
        description="Write DIR/report.html: the outcome in a sentence, the bodies in 3D, levels, "
        "forces, the case, and the command that repeats the run. The page needs no "
        "network and can be mailed. For two folders, write DIR/beside_NAME.html in the "
        "first one: numbers and pictures of both side by side, and the differences of "
        "their cases.",
    )
    report.add_argument(
        "results",
        metavar="DIR",
        nargs="+",
        help="result folder of perfplast run, or two folders to compare",
    )
    report.add_argument(
        "-o",
        "--output",
        metavar="PAGE",
        help="the page (default: DIR/report.html, or DIR/beside_NAME.html for two)",
    )

    claim = commands.add_parser(
        "claim",
        help="prove bounds again, and print them with the SHA-256 of their proofs",
        description="Check the proof files in DIR again. Print the bounds that they prove, with the"
        " file and SHA-256 of each, and what was taken as written. Where nothing is proven, say"
        " why, with exit status 2.",
    )
    claim.add_argument("results", metavar="DIR", help="folder with results of perfplast run")

    tools = commands.add_parser(
        "mcp",
        help="serve tools for programs by the Model Context Protocol",
        description="Serve the tools describe, template, mesh, check, run, status, claim and prove"
        " on standard input and output. They take paths in the given folders only; a case file may"
        " name files elsewhere. This needs the package mcp of PyPI.",
    )
    tools.add_argument(
        "folders", metavar="FOLDER", nargs="+", help="folder with files of the tools"
    )

    exported = commands.add_parser(
        "export",
        help="write fields and tables for other programs",
        description="Write DIR/export. With --vtu it contains fields.pvd, level_0001.vtu and so on "
        "for each level, and mechanism.vtu, for ParaView and other readers of VTK's XML "
        "files. With --csv it contains levels.csv, resultants.csv and bounds.csv. Without "
        "either option it contains both.",
    )
    exported.add_argument("results", metavar="DIR", help="result folder of perfplast run")
    exported.add_argument(
        "-o", "--output", metavar="FOLDER", help="folder for the files (default: DIR/export)"
    )
    exported.add_argument("--vtu", action="store_true", help="write the stored fields")
    exported.add_argument("--csv", action="store_true", help="write levels, forces and bounds")


def _add_references(commands: Any, scripts: argparse.ArgumentParser) -> None:
    """Add the commands that show results and lists; see :func:`_add_solving` for the arguments."""
    materials = commands.add_parser(
        "materials",
        help="show numbers of common materials, with their sources",
        description="Show numbers of common steels, aluminium, concrete, clay and ground as "
        "starting values, with their sources. For a design, take the numbers from its standard.",
    )
    materials.add_argument(
        "--units",
        choices=SYSTEMS,
        default=TABLE,
        help=f"as system under [units] in a case file (default: {TABLE})",
    )
    template = commands.add_parser(
        "template",
        help="show the entries of [design] and [[combination]] that a code requires, with clauses",
        description="Show tables for a case: the factors that a check of a code requires, and "
        "their clauses in the code. Without a name, list the names.",
    )
    template.add_argument("name", choices=TEMPLATES, nargs="?", help="name of the check")
    info = commands.add_parser(
        "info",
        parents=[scripts],
        help="show the meaning of the numbers of a case; or show versions, for bug reports",
        description="Print what the load factor of a case multiplies and the units of its numbers. "
        "Without a case, show versions, PETSc's packages, BLAS, ranks and threads, for "
        "bug reports.",
    )
    info.add_argument("case", metavar="CASE.toml", nargs="?", help="the case to describe")

    commands.add_parser(
        "doctor",
        help="test all requirements of a run, and report faults",
        description="Test the C compiler, DOLFINx, two ranks, one factorisation, gmsh and "
        "pictures, each in a separate process, and print a line for each, with the remedy. Exit "
        "status: 0 if all that is installed works, 2 otherwise.",
    )

    schema = commands.add_parser(
        "schema",
        help="show the JSON Schema of case files, with which editors complete and check them",
        description="Show the JSON Schema of case files, or write it to a file. An editor uses the "
        "file if a case begins with the line  #:schema ./case.schema.json  next to it.",
    )
    schema.add_argument("-o", "--output", metavar="SCHEMA", help="file to write or replace")
