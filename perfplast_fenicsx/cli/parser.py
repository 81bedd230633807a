"""Parse the command-line arguments and the PETSc options that follow them.

Exit status: 0 if all load levels are solved, 1 after a fault of the program, 2 for bad input, 3 if
a load level has no solution (earlier levels are valid) or a limit load is not found.

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
        help="make a mesh and a first case file from a geometry or from another program's model",
        description="Read the bodies of a geometry file, find the faces that touch, and write "
        "DIR/case.msh, DIR/case.toml and DIR/setup.html. Then choose materials, supports and "
        "loads on the page setup.html in a browser, or write them in DIR/case.toml. Lengths are "
        "in mm for STEP files. A model of another program (Abaqus, CalculiX: .inp; Salome: .med; "
        "I-DEAS: .unv; Nastran: .bdf; VTK: .vtu) already has a mesh: the command reads the mesh "
        "with its groups. From an .inp file it also reads materials, supports, loads, contacts "
        "and ties.",
    )
    mesh.add_argument(
        "geometry",
        metavar="DRAWING",
        help=".step, .stp, .brep, .iges, .igs, .geo; .inp, .med, .unv, .bdf, .nas, .fem, .vtu or"
        " .vtk",
    )
    mesh.add_argument("-o", "--output", metavar="DIR", required=True, help="output folder")
    mesh.add_argument(
        "--force", action="store_true", help="replace the mesh and the case file in DIR"
    )
    _add_sizes(mesh)
    _add_bodies(mesh)


def _add_sizes(mesh: argparse.ArgumentParser) -> None:
    """Add the options for element sizes and element order."""
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
        help="number of elements around a circle (default: 10, or more if areas would otherwise be "
        "off by more than 1 %%)",
    )
    mesh.add_argument(
        "--order", type=int, choices=(1, 2), default=1, help="2 for curved elements (default: 1)"
    )
    mesh.add_argument(
        "--patience",
        metavar="S",
        type=float,
        default=600.0,
        help="time limit for meshing, in seconds (default: 600)",
    )


def _add_bodies(mesh: argparse.ArgumentParser) -> None:
    """Add the options for the bodies and their joints."""
    mesh.add_argument(
        "--without",
        metavar="BODY",
        action="append",
        default=[],
        help="name of a body to leave out (may be repeated)",
    )
    mesh.add_argument(
        "--symmetry",
        metavar="AXIS=X",
        action="append",
        default=[],
        help="plane of symmetry, such as x=0; the half with the larger coordinates is kept (may "
        "be repeated)",
    )
    mesh.add_argument(
        "--apart",
        action="store_true",
        help="mesh each body separately; contact then uses the mortar method, even where bodies "
        "share a face in the drawing",
    )
    mesh.add_argument(
        "--overlap",
        metavar="SHARE",
        type=float,
        default=1e-3,
        help="largest fraction of a body's volume that may overlap another body (default: 0.001)",
    )
    mesh.add_argument(
        "--close-gaps",
        metavar="GAP",
        type=float,
        default=0.0,
        help="largest gap that is closed: faces of bodies at most this far apart touch (default: "
        "0)",
    )
    mesh.add_argument(
        "--material",
        metavar="NAME",
        help="material for all bodies ('perfplast materials' lists the names)",
    )
    glued = mesh.add_mutually_exclusive_group()
    glued.add_argument(
        "--glued", "--tied", dest="tied", action="store_true", help="glue all bodies that touch"
    )
    glued.add_argument("--bolted", action="store_true", help="glue only nuts to their threads")


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
"""Suffixes of the files that an argument may name, by the metavar of the argument."""


def complete(parser: argparse.ArgumentParser, **settings: Any) -> None:
    """Answer a completion request from the shell and end the process, or do nothing.

    Args:
        parser: The parser with all commands.
        settings: Arguments of ``argcomplete.autocomplete``, for tests.
    """
    if "_ARGCOMPLETE" not in os.environ:
        return
    try:
        import argcomplete
        from argcomplete.completers import DirectoriesCompleter, FilesCompleter
    except ImportError:
        return
    folders = ("DIR", "FOLDER")  # metavars of arguments that are folders
    for action in _actions(parser):
        if action.metavar in folders:
            vars(action)["completer"] = DirectoriesCompleter()
        elif isinstance(action.metavar, str) and action.metavar in ENDINGS:
            vars(action)["completer"] = FilesCompleter(ENDINGS[action.metavar])
    argcomplete.autocomplete(parser, **settings)


def _actions(parser: argparse.ArgumentParser) -> list[argparse.Action]:
    """Return the argparse actions of a parser and of its commands."""
    found = list(parser._actions)
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            found += [deeper for command in action.choices.values() for deeper in _actions(command)]
    return found


SOLVED, FAULT, BAD_INPUT, NO_SOLUTION = range(4)
"""Exit statuses of the command line; an interrupted run ends with 128 plus the signal's number."""

LOG_LEVELS = ("debug", "info", "warning", "error")

RANKS = ("OMPI_COMM_WORLD_RANK", "PMI_RANK", "PMIX_RANK", "SLURM_PROCID")
"""Environment variables in which MPI launchers store the rank of a process."""


def read_arguments(arguments: Sequence[str]) -> argparse.Namespace:
    """Return the command and its arguments as a namespace. Not collective.

    Args:
        arguments: The command-line arguments without the program name.

    Returns:
        The values by name; ``petsc`` contains the arguments after ``--``, which
        :func:`set_petsc_options` reads.

    Raises:
        InputError: If the arguments are not valid.
        SystemExit: After the help or the version is printed.
    """
    for argument in arguments:
        if not argument.isprintable() and any("\udc80" <= c <= "\udcff" for c in argument):
            raise InputError(f"the argument '{argument}' is not in UTF-8; give it in UTF-8.")
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
        raise InputError(
            f"perfplast {chosen.command} takes no PETSc options; remove '--' and the "
            "arguments after it."
        )
    if chosen.command in ("run", "sweep") and chosen.restart and chosen.force:
        raise InputError(
            "--restart continues from existing results, but --force replaces them; give only one "
            "of these options."
        )
    if chosen.command == "run" and chosen.restart and chosen.refine:
        raise InputError(
            "--restart continues one run, but --refine starts two; give only one of these options."
        )
    if chosen.command == "plot" and not chosen.wait >= 0:  # also refuses NaN
        raise InputError(f"--wait = {chosen.wait:g} is not a valid time; give 0 s or more.")
    chosen.petsc = petsc
    return chosen


def set_petsc_options(arguments: Sequence[str]) -> None:
    """Add options such as ``-perfplast_ksp_rtol 1e-10`` to PETSc's options database.

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
                f"'{argument}' after '--' is neither a PETSc option nor the value of one; write "
                "for example -- -perfplast_ksp_rtol 1e-10."
            )
    check_options(given)
    for name, value in given.items():
        options[name] = value
    # PETSc would warn of unused options, because the solvers read copies of the options
    for name in given:
        if name.startswith("perfplast_"):
            options.hasName(name)


class _Parser(argparse.ArgumentParser):
    """A parser that prints only on rank 0, and raises InputError instead of printing its usage."""

    commands: Mapping[str, argparse.ArgumentParser]

    def options(self, command: str) -> list[str]:
        """Return the option names of a command."""
        return list(self.commands[command]._option_string_actions)

    def error(self, message: str) -> NoReturn:
        raise InputError(f"{message}; see {self.prog} --help.")

    def _print_message(self, message: str, file: object = None) -> None:
        rank = next((os.environ[name] for name in RANKS if name in os.environ), "0")
        if rank == "0":
            super()._print_message(message, file)  # type: ignore[arg-type]


def _add_results(command: argparse.ArgumentParser) -> None:
    """Add the arguments that ``run`` and ``sweep`` share."""
    command.add_argument("case", metavar="CASE.toml", help="the case to solve")
    where = command.add_mutually_exclusive_group(required=True)
    where.add_argument("-o", "--output", metavar="DIR", help="result folder")
    where.add_argument(
        "--restart",
        metavar="DIR",
        help="continue the run in this folder from its last solved level",
    )
    command.add_argument(
        "-n",
        "--ranks",
        metavar="N",
        type=int,
        help="number of MPI ranks to start; the program finds the matching mpirun",
    )
    command.add_argument("--force", action="store_true", help="replace existing results in DIR")
    pages = command.add_mutually_exclusive_group()
    pages.add_argument("--report", action="store_true", help="write DIR/report.html at the end")
    pages.add_argument(
        "--watch",
        action="store_true",
        help="update DIR/report.html during the run and write it at the end; reload the page in a "
        "browser to see the progress",
    )
    command.add_argument(
        "--log-level",
        choices=LOG_LEVELS,
        default="warning",
        help="lowest level of the messages on standard error; info shows every Newton step, and "
        "DIR/run.log always contains these steps (default: warning)",
    )
    command.add_argument(
        "--quiet",
        action="store_true",
        help="print nothing on standard output; warnings still appear",
    )


def make_parser() -> _Parser:
    """Return the parser with all commands."""
    parser = _Parser(
        prog="perfplast",
        description="Analyse elastic-plastic bodies in contact, and compute the loads at which "
        "they collapse.",
        epilog="Exit status: 0 all load levels are solved, 1 fault of the program, 2 bad input, 3 "
        "a load level has no solution (earlier levels are valid), 130 or 143 interrupted "
        "(--restart continues the run).",
    )
    parser.add_argument("--version", action="version", version=f"perfplast {__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    scripts = _Parser(add_help=False)
    scripts.add_argument(
        "--trust",
        action="store_true",
        help="allow gmsh to run a .geo script. Such a script may execute any command: use this "
        "option only if you know what the script contains",
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
                help="print one JSON object on standard output, and the usual lines on standard "
                "error",
            )
    return parser


def _add_solving(commands: Any, scripts: argparse.ArgumentParser) -> None:
    """Add the commands ``run`` and ``sweep``, which solve.

    Args:
        commands: Sub-parsers.
        scripts: Parser with the options of all commands that may run a script.
    """
    run = commands.add_parser(
        "run",
        parents=[scripts],
        help="solve a case",
        description="Solve a case on any number of ranks, e.g. perfplast run -n 2 ...",
        epilog="Give PETSc options after two dashes, for example -- -perfplast_ksp_rtol 1e-10. "
        "Options -perfplast_ksp_... apply to the linear solver, and -perfplast_vi_... to the "
        "search for the active contact set.",
    )
    _add_results(run)
    run.add_argument(
        "--refine",
        action="store_true",
        help="also solve the case with elements of half the size, in DIR/half, and compare both "
        "runs in a table",
    )

    sweep = commands.add_parser(
        "sweep",
        parents=[scripts],
        help="solve a case for several values of its keys, and collect all results in one table",
        description="Solve a case for each value, or for each combination of values. Each "
        "solution has its own folder: DIR/0001, DIR/0002 and so on. DIR/sweep.csv and "
        "DIR/sweep.png contain all results.",
    )
    _add_results(sweep)
    sweep.add_argument(
        "--vary",
        metavar="KEY=VALUES",
        action="append",
        required=True,
        help="a key of the case, with values as FROM:TO:NUMBER or A,B,C; for example "
        "material.block.yield_stress=200:300:5 or load.top.pressure=1,2 (may be repeated)",
    )


def _add_setup(commands: Any) -> None:
    """Add ``setup``; see :func:`_add_solving` for the arguments."""
    setup = commands.add_parser(
        "setup",
        help="open the page on which you set up a case in a browser",
        description="Open the page DIR/setup.html, which 'perfplast mesh' writes, in a browser. "
        "If there is no screen, print the address of the page.",
    )
    setup.add_argument("folder", metavar="DIR", help="output folder of 'perfplast mesh'")


def _add_check(commands: Any, scripts: argparse.ArgumentParser) -> None:
    """Add ``check``; see :func:`_add_solving` for the arguments."""
    check = commands.add_parser(
        "check",
        parents=[scripts],
        help="check a case without solving it: print and draw how the program reads it",
        description="Perform all tests that 'perfplast run' performs before its first solve, "
        "except the test for memory. Print which faces each load and each support covers, which "
        "faces touch and which are free, and draw these faces.",
    )
    check.add_argument("case", metavar="CASE.toml", help="the case to check")
    check.add_argument(
        "-o",
        "--output",
        metavar="PICTURE",
        help="PNG file for the picture (default: case.png in the folder of CASE.toml; no picture "
        "if the case has pictures = false under [output])",
    )


def _add_pictures(commands: Any) -> None:
    """Add the commands that draw results."""
    plot = commands.add_parser(
        "plot",
        help="draw the loading curve, plastic zone, mechanism and contact pressure",
        description="Draw path.png, fields.png, mechanism.png and further pictures from the "
        "results of a run, which may still be in progress. The pictures are drawn on "
        "one rank.",
    )
    plot.add_argument("results", metavar="DIR", help="result folder of perfplast run")
    plot.add_argument(
        "-o", "--output", metavar="FOLDER", help="folder for the pictures (default: DIR)"
    )
    plot.add_argument(
        "--follow",
        action="store_true",
        help="print and draw each level when it is solved, with the number of levels left, until "
        "the run ends",
    )
    plot.add_argument(
        "--wait",
        metavar="SECONDS",
        type=float,
        default=60.0,
        help="with --follow: time to wait for the first results (default: 60)",
    )

    animate = commands.add_parser(
        "animate",
        help="show the loading as an animation",
        description="Show the plastic zone, the contact pressure and the loading curve of a run, "
        "level by level. The frames are drawn on one rank.",
    )
    animate.add_argument("results", metavar="DIR", help="result folder of perfplast run")
    animate.add_argument(
        "-o",
        "--output",
        metavar="FILE",
        help="output file, *.gif or *.webp (default: DIR/loading.gif)",
    )


def _add_pages(commands: Any) -> None:
    """Add the commands ``report``, ``claim``, ``mcp`` and ``export``."""
    report = commands.add_parser(
        "report",
        help="write a report as one HTML page",
        description="Write DIR/report.html with the outcome in one sentence, the bodies in 3D, "
        "load levels, forces, the case, and the command that repeats the run. The page is one "
        "file and needs no network. For two folders, write beside_NAME.html in the first "
        "folder: it shows numbers and pictures of both runs side by side, and how their cases "
        "differ.",
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
        help="output file (default: DIR/report.html; for two folders DIR/beside_NAME.html)",
    )

    claim = commands.add_parser(
        "claim",
        help="check proofs again, and print the proven bounds with the SHA-256 of each proof",
        description="Check the proof files in DIR again. Print the bounds that they prove, the "
        "name and SHA-256 of each proof file, and the data that the checker takes as given. "
        "If nothing is proven, print the reason and end with exit status 2.",
    )
    claim.add_argument("results", metavar="DIR", help="result folder of perfplast run")

    tools = commands.add_parser(
        "mcp",
        help="serve tools to other programs by the Model Context Protocol",
        description="Serve the tools describe, template, mesh, check, run, status, claim and "
        "prove on standard input and output. The tools accept only paths inside the given "
        "folders, but a case file may name files outside them. The command needs the package "
        "mcp from PyPI.",
    )
    tools.add_argument(
        "folders", metavar="FOLDER", nargs="+", help="folder whose files the tools may use"
    )

    exported = commands.add_parser(
        "export",
        help="write fields and tables for other programs",
        description="Write a folder DIR/export. With --vtu it contains fields.pvd, mechanism.vtu "
        "and one file for each level (level_0001.vtu and so on), for ParaView and other "
        "readers of VTK's XML files. With --csv it contains levels.csv, resultants.csv and "
        "bounds.csv. Without these options it contains all of these files.",
    )
    exported.add_argument("results", metavar="DIR", help="result folder of perfplast run")
    exported.add_argument(
        "-o", "--output", metavar="FOLDER", help="folder for the files (default: DIR/export)"
    )
    exported.add_argument("--vtu", action="store_true", help="write the stored fields")
    exported.add_argument(
        "--csv", action="store_true", help="write tables of levels, forces and bounds"
    )


def _add_references(commands: Any, scripts: argparse.ArgumentParser) -> None:
    """Add commands that show lists and versions; see :func:`_add_solving` for the arguments."""
    materials = commands.add_parser(
        "materials",
        help="show parameters of common materials, with their sources",
        description="Show parameters of common steels, aluminium, concrete, clay and ground, with "
        "their sources. Use them as starting values. For a design, take the parameters from "
        "the standard that applies.",
    )
    materials.add_argument(
        "--units",
        choices=SYSTEMS,
        default=TABLE,
        help=f"system of units, as under [units] in a case file (default: {TABLE})",
    )
    template = commands.add_parser(
        "template",
        help="show the tables [design] and [[combination]] that a design code requires, with its "
        "clauses",
        description="Show the tables of a case file with the factors that a design code requires "
        "for a check, and the clauses of the code. Without a name, list the names of all "
        "checks.",
    )
    template.add_argument("name", choices=TEMPLATES, nargs="?", help="name of the check")
    info = commands.add_parser(
        "info",
        parents=[scripts],
        help="explain the numbers of a case; without a case, show versions for a bug report",
        description="Print the loads that the load factor of a case multiplies, and the units of "
        "its numbers. Without a case, print versions, PETSc's packages, BLAS, ranks and "
        "threads for a bug report.",
    )
    info.add_argument("case", metavar="CASE.toml", nargs="?", help="the case to describe")

    commands.add_parser(
        "doctor",
        help="test all requirements of a run, and report faults",
        description="Test the C compiler, DOLFINx, a start of two ranks, one factorisation, gmsh "
        "and pictures, each in a separate process. Print one line for each test, with a "
        "remedy if it fails. Exit status: 0 if everything that is installed works, 2 "
        "otherwise.",
    )

    schema = commands.add_parser(
        "schema",
        help="show the JSON Schema of case files, which editors use to complete and check the "
        "files",
        description="Print the JSON Schema of case files, or write it to a file. An editor uses "
        "the file if the first line of a case in the same folder is  #:schema "
        "./case.schema.json",
    )
    schema.add_argument("-o", "--output", metavar="SCHEMA", help="file to write or replace")
