"""Execute the commands of the command line and return their exit status."""

import argparse
import json
import tomllib
from pathlib import Path
from typing import Any

from mpi4py import MPI

from perfplast_fenicsx.atomic_files import replace
from perfplast_fenicsx.cli.case_picture import PICTURE, draw_case
from perfplast_fenicsx.cli.json_answer import Answer
from perfplast_fenicsx.cli.mesh_command import (
    address_of,
    common_materials,
    is_model,
    library,
    mesh,
    mesh_model,
    meshing_options,
    open_page,
    surveyed,
)
from perfplast_fenicsx.cli.parser import SOLVED, set_petsc_options
from perfplast_fenicsx.cli.result_commands import (
    claim,
    draw,
    export_results,
    follow,
    pictures_in,
    report,
    results_in,
)
from perfplast_fenicsx.cli.run import Flags, admitted_solver, on_bodies, run, warn_of
from perfplast_fenicsx.cli.run_log import coded_warnings, logged_to_console, surroundings, versions
from perfplast_fenicsx.cli.several_runs import run_combined, run_refined, sweep
from perfplast_fenicsx.cli.signals import leave_pipes_to_python
from perfplast_fenicsx.cli.terminal import Terminal, describe
from perfplast_fenicsx.cli.understood import understood
from perfplast_fenicsx.errors import InputError, on_all_ranks, on_rank0, visible
from perfplast_fenicsx.extensions import load_extensions
from perfplast_fenicsx.geometry.first_case import Glued
from perfplast_fenicsx.geometry.survey import Survey
from perfplast_fenicsx.io.case.case_reader import read_case
from perfplast_fenicsx.io.case.case_schema import case_schema
from perfplast_fenicsx.io.case.code_templates import TEMPLATES, templates_in_words
from perfplast_fenicsx.io.case.load_table import meaning
from perfplast_fenicsx.report.report_file import Reporting

Fields = dict[str, Any]
"""Values of the JSON answer by key."""


def execute(comm: MPI.Intracomm, chosen: argparse.Namespace, answer: Answer) -> int:
    """Execute a command and return its exit status, the same on every rank. Collective.

    Args:
        comm: The ranks of the run.
        chosen: The command and its arguments, from :func:`~.parser.read_arguments`.
        answer: The JSON answer, to which this function adds values and warnings.

    Raises:
        InputError: If the input cannot be used.
    """
    leave_pipes_to_python()  # the imports above have started PETSc, which handles SIGPIPE
    set_petsc_options(chosen.petsc)
    on_all_ranks(comm, load_extensions)
    with coded_warnings(comm, answer.warnings):
        if chosen.command in ("run", "sweep"):
            return _solve(comm, chosen, answer.fields)
        with logged_to_console(comm):
            return _look(comm, chosen, answer.fields)


def _solve(comm: MPI.Intracomm, chosen: argparse.Namespace, fields: Fields) -> int:
    """Execute ``run`` or ``sweep``. Collective."""
    steps_shown = chosen.log_level in ("debug", "info")  # a live line would mix with these steps
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
                status = sweep(comm, chosen.case, output, terminal, chosen.vary, flags)
            elif chosen.refine:
                status = run_refined(comm, chosen.case, output, terminal, flags)
            else:
                case = read_case(chosen.case, comm, chosen.trust)
                if case.combinations:
                    status = run_combined(comm, case, output, terminal, flags)
                else:
                    status = run(comm, chosen.case, output, terminal, flags)
        finally:
            terminal.clear()
        if chosen.json:
            fields |= on_rank0(comm, lambda: results_in(output, chosen.command)) or {}
        return status


def _look(comm: MPI.Intracomm, chosen: argparse.Namespace, fields: Fields) -> int:
    """Execute a command other than ``run`` and ``sweep``. Collective."""
    command, terminal = chosen.command, Terminal(comm)
    if command == "check":
        return check(comm, chosen.case, chosen.trust, chosen.output, fields)
    if command == "setup":
        terminal.say(on_rank0(comm, lambda: open_page(chosen.folder)) or "")
        fields["page"] = address_of(chosen.folder)
    elif command == "info":
        about(comm, chosen.case, fields, chosen.trust) if chosen.case else info(comm, fields)
    elif command == "materials":
        terminal.say(common_materials(chosen.units))
        fields |= {"system": chosen.units, "materials": library(chosen.units)}
    elif command == "template":
        terminal.say(TEMPLATES[chosen.name] if chosen.name else templates_in_words())
        fields["names"] = list(TEMPLATES)
        fields["tables"] = tomllib.loads(TEMPLATES[chosen.name]) if chosen.name else None
    elif command == "schema":
        schema(comm, chosen.output, fields)
    elif command == "mesh":
        survey = mesh_model(comm, chosen) if is_model(chosen.geometry) else _mesh(comm, chosen)
        if survey is not None:
            fields |= surveyed(survey, chosen.output)
    elif command == "export":
        kinds = {kind for kind in ("vtu", "csv") if getattr(chosen, kind)}
        fields["files"] = export_results(comm, chosen.results, chosen.output, kinds)
    elif command == "claim":
        fields |= claim(comm, chosen.results)
    elif command == "report":
        fields["files"] = report(comm, chosen.results, chosen.output)
    elif command == "plot" and chosen.follow:
        follow(comm, chosen.results, chosen.output, chosen.wait)
        fields["files"] = pictures_in(chosen.output or chosen.results)
    else:
        fields["files"] = draw(comm, command, chosen.results, chosen.output)
    return SOLVED


def _mesh(comm: MPI.Intracomm, chosen: argparse.Namespace) -> Survey | None:
    """Execute ``mesh`` for a geometry file; return the survey on rank 0. Collective."""
    glued = Glued.ALL if chosen.tied else Glued.BOLTS if chosen.bolted else Glued.SHARED
    where = (chosen.geometry, chosen.output, meshing_options(chosen))
    return mesh(comm, *where, chosen.material, glued, chosen.force, chosen.trust)


def check(comm: MPI.Intracomm, path: str, trust: bool, picture: str | None, fields: Fields) -> int:
    """Check a case with its mesh, names and contacts, but do not solve it. Collective.

    Args:
        comm: The ranks of the run.
        path: Path of the case file.
        trust: Whether to run a script that makes the mesh.
        picture: PNG file for the picture of the case; None for ``case.png`` next to the case file,
            or for no picture if the case has ``pictures = false``.
        fields: Values of the JSON answer, to which this function adds its own.

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
    cells = problem.tagged_mesh.mesh.topology.index_map(problem.tagged_mesh.mesh.topology.dim)
    fields |= {
        "title": case.title,
        "bodies": sorted(problem.tagged_mesh.volumes),
        "cells": cells.size_global,
        "dofs": problem.num_dofs,
        "contact_pairs": problem.num_pairs,
        "method": str(method),
    }
    if picture or case.output.pictures:
        drawn = Path(picture) if picture else case.path.parent / PICTURE
        if draw_case(case, problem, found, drawn):
            Terminal(comm).say(f"Picture of the case: {drawn}")
            fields["picture"] = str(drawn)
    return SOLVED


def info(comm: MPI.Intracomm, fields: Fields) -> None:
    """Print the versions of the program and its libraries, and data of the machine. Collective.

    Args:
        comm: The ranks of the run.
        fields: Values of the JSON answer, to which this function adds its own.
    """
    found = versions() | surroundings(comm)
    width = max(map(len, found))
    Terminal(comm).say("\n".join(f"{name:{width}}  {text}" for name, text in found.items()))
    fields["versions"] = found


def about(comm: MPI.Intracomm, path: str, fields: Fields, trust: bool) -> None:
    """Print the bodies of a case, and the meaning of its load factor and units. Collective.

    Args:
        comm: The ranks of the run.
        path: Path of the case file.
        fields: Values of the JSON answer, to which this function adds its own.
        trust: Whether to run a script that makes the mesh.

    Raises:
        InputError: If the case cannot be used.
    """
    case = read_case(path, comm, trust)
    tagged_mesh = case.tagged_mesh(comm)
    terminal = Terminal(comm)
    terminal.say(f"{visible(case.title)}: {', '.join(case.materials)}")
    meant = meaning(case, tagged_mesh.kinematics.whole)
    for text in meant:
        terminal.say(text)
    fields |= {"title": case.title, "bodies": list(case.materials), "meaning": list(meant)}


def schema(comm: MPI.Intracomm, output: str | None, fields: Fields) -> None:
    """Print the JSON Schema of case files, or write it to a file on rank 0. Collective.

    Args:
        comm: The ranks of the run.
        output: The file; None for standard output.
        fields: Values of the JSON answer, to which this function adds its own.

    Raises:
        InputError: If the file cannot be written.
    """
    fields |= {"schema": case_schema(), "file": output}
    text = json.dumps(fields["schema"], indent=2, ensure_ascii=False)

    def write() -> None:
        try:
            replace(Path(str(output)), f"{text}\n".encode())
        except OSError as error:
            raise InputError(
                f"'{output}' cannot be written ({error.strerror}); name another file."
            ) from error

    if output is None:
        Terminal(comm).say(text)
    else:
        on_rank0(comm, write)
        Terminal(comm).say(output)
