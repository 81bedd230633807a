"""Implement the commands: each function executes one and returns the exit status."""

import argparse
import json
from pathlib import Path

from mpi4py import MPI

from perfplast_fenicsx.atomic_files import replace
from perfplast_fenicsx.cli.combined_run import run_combined
from perfplast_fenicsx.cli.mesh_command import common_materials, mesh, meshing_options
from perfplast_fenicsx.cli.mesh_folder import open_page
from perfplast_fenicsx.cli.model_command import is_model, mesh_model
from perfplast_fenicsx.cli.parser import SOLVED, set_petsc_options
from perfplast_fenicsx.cli.refined_run import run_refined
from perfplast_fenicsx.cli.result_commands import claim, draw, export_results, follow, report
from perfplast_fenicsx.cli.run import Flags, admitted_solver, on_bodies, run, warn_of
from perfplast_fenicsx.cli.run_log import logged_to_console
from perfplast_fenicsx.cli.signals import leave_pipes_to_python
from perfplast_fenicsx.cli.sweep_command import sweep
from perfplast_fenicsx.cli.system_info import surroundings, versions
from perfplast_fenicsx.cli.terminal import Terminal, describe
from perfplast_fenicsx.cli.understood import PICTURE, draw_case, understood
from perfplast_fenicsx.errors import InputError, on_all_ranks, on_rank0, visible
from perfplast_fenicsx.extensions import load_extensions
from perfplast_fenicsx.geometry.glued import Glued
from perfplast_fenicsx.io.case.case_reader import read_case
from perfplast_fenicsx.io.case.case_schema import case_schema
from perfplast_fenicsx.io.case.code_templates import TEMPLATES, templates_in_words
from perfplast_fenicsx.io.case.load_words import meaning
from perfplast_fenicsx.report.report_file import Reporting


def execute(comm: MPI.Intracomm, chosen: argparse.Namespace) -> int:
    """Execute a command and return its exit status, the same on every rank. Collective.

    Args:
        comm: The ranks of the run.
        chosen: The command and its arguments, from :func:`~.parser.read_arguments`.

    Raises:
        InputError: If the input cannot be used.
    """
    leave_pipes_to_python()  # the imports above have started PETSc
    set_petsc_options(chosen.petsc)
    on_all_ranks(comm, load_extensions)
    if chosen.command in ("run", "sweep"):
        steps_shown = chosen.log_level in ("debug", "info")  # without a live line between them
        live = False if steps_shown else None
        terminal = Terminal(comm, live=live, quiet=chosen.quiet)
        with logged_to_console(comm, chosen.log_level, terminal.clear):
            output = chosen.restart or chosen.output
            pages = Reporting.AT_END if chosen.report else Reporting.NEVER
            flags = Flags(
                force=chosen.force,
                restart=chosen.restart is not None,
                report=Reporting.LIVE if chosen.watch else pages,
                trust=chosen.trust,
                log_level=chosen.log_level,
            )
            try:
                if chosen.command == "sweep":
                    return sweep(comm, chosen.case, output, terminal, chosen.vary, flags)
                if chosen.refine:
                    return run_refined(comm, chosen.case, output, terminal, flags)
                case = read_case(chosen.case, comm, chosen.trust)
                if case.combinations:
                    return run_combined(comm, case, output, terminal, flags)
                return run(comm, chosen.case, output, terminal, flags)
            finally:
                terminal.clear()
    with logged_to_console(comm):
        if chosen.command == "check":
            return check(comm, chosen.case, chosen.trust, chosen.output)
        if chosen.command == "setup":
            Terminal(comm).say(on_rank0(comm, lambda: open_page(chosen.folder)) or "")
            return SOLVED
        if chosen.command == "info":
            return about(comm, chosen.case, chosen.trust) if chosen.case else info(comm)
        if chosen.command == "materials":
            Terminal(comm).say(common_materials(chosen.units))
            return SOLVED
        if chosen.command == "template":
            Terminal(comm).say(TEMPLATES[chosen.name] if chosen.name else templates_in_words())
            return SOLVED
        if chosen.command == "schema":
            return schema(comm, chosen.output)
        if chosen.command == "mesh" and is_model(chosen.geometry):
            mesh_model(comm, chosen)
            return SOLVED
        if chosen.command == "mesh":
            glued = Glued.ALL if chosen.tied else Glued.BOLTS if chosen.bolted else Glued.SHARED
            where = (chosen.geometry, chosen.output, meshing_options(chosen))
            mesh(comm, *where, chosen.material, glued, chosen.force, chosen.trust)
            return SOLVED
        if chosen.command == "export":
            kinds = {kind for kind in ("vtu", "csv") if getattr(chosen, kind)}
            return export_results(comm, chosen.results, chosen.output, kinds)
        if chosen.command == "claim":
            return claim(comm, chosen.results, chosen.json)
        if chosen.command == "report":
            return report(comm, chosen.results, chosen.output)
        if chosen.command == "plot" and chosen.follow:
            return follow(comm, chosen.results, chosen.output, chosen.wait)
        return draw(comm, chosen.command, chosen.results, chosen.output)


def check(comm: MPI.Intracomm, path: str, trust: bool = False, picture: str | None = None) -> int:
    """Check a case with its mesh, names and contact, without solving it. Collective.

    Args:
        comm: The ranks of the run.
        path: Path of the case file.
        trust: Whether to run a script that makes the mesh.
        picture: PNG file for the picture of the program's reading; None for ``case.png`` next to
            the case, unless the case switches pictures off.

    Raises:
        InputError: If the case cannot be used.
    """
    case = read_case(path, comm, trust)
    problem = case.problem(comm)
    case.history(problem)
    warn_of(comm, case, problem)
    method = case.method_on(problem)
    each = [(case, problem)]
    if case.combinations:
        combined = [case.combined(combination) for combination in case.combinations]
        each = [(one, on_bodies(problem, one)) for one in combined]
    for one, on in each:
        admitted_solver(one, on, one.method_on(on))
    text = describe(case.title, method, problem, case.options, case.conic)
    found = understood(case, problem)
    lines = found.lines if found else []
    Terminal(comm).say("\n".join([*lines, text, f"{case.path} can be run."]))
    if picture or case.output.pictures:
        drawn = Path(picture) if picture else case.path.parent / PICTURE
        if draw_case(case, problem, found, drawn):
            Terminal(comm).say(f"Picture of the program's reading: {drawn}")
    return SOLVED


def info(comm: MPI.Intracomm) -> int:
    """Print versions and data of the machine. Collective."""
    found = versions() | surroundings(comm)
    width = max(map(len, found))
    Terminal(comm).say("\n".join(f"{name:{width}}  {text}" for name, text in found.items()))
    return SOLVED


def about(comm: MPI.Intracomm, path: str, trust: bool = False) -> int:
    """Print the meaning of the numbers of a case. Collective.

    Args:
        comm: The ranks of the run.
        path: Path of the case file.
        trust: Whether to run a script that makes the mesh.

    Raises:
        InputError: If the case cannot be used.
    """
    case = read_case(path, comm, trust)
    tagged_mesh = case.tagged_mesh(comm)
    terminal = Terminal(comm)
    terminal.say(f"{visible(case.title)}: {', '.join(case.materials)}")
    for text in meaning(case, tagged_mesh.kinematics.whole):
        terminal.say(text)
    return SOLVED


def schema(comm: MPI.Intracomm, output: str | None) -> int:
    """Print the JSON Schema of case files, or write it to a file on rank 0. Collective.

    Args:
        comm: The ranks of the run.
        output: The file; None for standard output.

    Raises:
        InputError: If the file cannot be written.
    """
    text = json.dumps(case_schema(), indent=2, ensure_ascii=False)

    def write() -> None:
        try:
            replace(Path(str(output)), f"{text}\n".encode())
        except OSError as error:
            raise InputError(f"'{output}' cannot be written: {error.strerror}.") from error

    if output is None:
        Terminal(comm).say(text)
    else:
        on_rank0(comm, write)
        Terminal(comm).say(output)
    return SOLVED
