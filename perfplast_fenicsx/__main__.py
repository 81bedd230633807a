"""The command line: ``perfplast run CASE.toml -o DIR``, and what comes before and after it.

Exit status: 0 all load levels solved, 1 a fault of the program, 2 bad input, 3 a load level without
a solution (a result like any other: the levels before it are valid).
"""

import io
import json
import signal
import sys
import traceback
from collections.abc import Sequence
from pathlib import Path

from mpi4py import MPI

from perfplast_fenicsx.atomic_files import replace
from perfplast_fenicsx.cli.combined_run import run_combined
from perfplast_fenicsx.cli.follow import Follower
from perfplast_fenicsx.cli.mesh_command import common_materials, mesh, meshing_options
from perfplast_fenicsx.cli.model_command import is_model, mesh_model
from perfplast_fenicsx.cli.parser import read_arguments
from perfplast_fenicsx.cli.refined_run import run_refined
from perfplast_fenicsx.cli.run import BAD_INPUT, FAULT, SOLVED, run, warn_of
from perfplast_fenicsx.cli.run_log import logged_to_console
from perfplast_fenicsx.cli.signals import leave_pipes_to_python
from perfplast_fenicsx.cli.sweep_command import sweep
from perfplast_fenicsx.cli.system_info import surroundings, versions
from perfplast_fenicsx.cli.terminal import Terminal, describe
from perfplast_fenicsx.errors import InputError, on_rank0, visible
from perfplast_fenicsx.export.exported_files import export
from perfplast_fenicsx.geometry.glued import Glued
from perfplast_fenicsx.io.case.case_reader import read_case
from perfplast_fenicsx.io.case.case_schema import case_schema
from perfplast_fenicsx.io.case.code_templates import TEMPLATES, templates_in_words
from perfplast_fenicsx.io.case.load_words import meaning
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitMethod
from perfplast_fenicsx.pictures.drawing_process import animate, plot
from perfplast_fenicsx.problem.judged.slip import check_slip_is_true
from perfplast_fenicsx.report.beside import write_beside
from perfplast_fenicsx.report.report_file import write_report


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line. Collective.

    Args:
        argv: Arguments; those of the process by default.

    Returns:
        The exit status, the same on every rank.
    """
    comm = MPI.COMM_WORLD
    arguments = list(sys.argv[1:] if argv is None else argv)
    leave_pipes_to_python()
    for stream in (sys.stdout, sys.stderr):  # a reason may have a Greek letter in it
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    try:
        status = _command(comm, arguments)
    except InputError as error:
        if comm.rank == 0:
            print(f"perfplast: {error}", file=sys.stderr, flush=True)
        status = BAD_INPUT
    except SystemExit as end:  # --help and --version
        status = int(end.code or 0)
    except KeyboardInterrupt as stop:
        number = signal.Signals(stop.args[0] if stop.args else signal.SIGINT)
        told = f"perfplast: ended at once by {number.name}; levels that were solved are on file."
        print(told, file=sys.stderr, flush=True)
        status = 128 + number
        if comm.size > 1:
            comm.Abort(status)
        return status
    except Exception:
        traceback.print_exc()
        sys.stderr.flush()
        if comm.size > 1:  # the others may wait for this rank
            comm.Abort(FAULT)
        return FAULT
    comm.barrier()  # a launcher may end the others as soon as one rank has ended
    return status


def check(comm: MPI.Intracomm, path: str, trust: bool = False) -> int:
    """Check a case, its mesh, names and contact included, without solving it. Collective.

    Args:
        comm: The ranks.
        path: Case file.
        trust: Run a script that the mesh is made of.

    Raises:
        InputError: If the case cannot be used.
    """
    case = read_case(path, comm, trust)
    problem = case.problem(comm)
    case.history(problem)
    warn_of(comm, case, problem)
    method = case.method_on(problem)
    if method != LimitMethod.INTERIOR_POINT:
        check_slip_is_true(problem)
    text = describe(case.title, method, problem, case.options)
    Terminal(comm).say(f"{text}\n{case.path} can be run.")
    return SOLVED


def info(comm: MPI.Intracomm) -> int:
    """Show what the program runs on. Collective."""
    found = versions() | surroundings(comm)
    width = max(map(len, found))
    Terminal(comm).say("\n".join(f"{name:{width}}  {text}" for name, text in found.items()))
    return SOLVED


def about(comm: MPI.Intracomm, path: str, trust: bool = False) -> int:
    """Say what the numbers of a case mean. Collective.

    Args:
        comm: The ranks.
        path: Case file.
        trust: Run a script that the mesh is made of.

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
    """Show the JSON Schema of case files, or write it by rank 0. Collective.

    Args:
        comm: The ranks.
        output: The file; None for standard output.

    Raises:
        InputError: If the system refuses to write it.
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


def follow(comm: MPI.Intracomm, results: str, output: str | None, wait: float) -> int:
    """Show and draw what a run writes until it ends, by rank 0. Collective.

    Args:
        comm: The ranks; the others wait.
        results: Folder of the run.
        output: Where the pictures go; by default to the results.
        wait: Longest time for first results (s).

    Raises:
        InputError: If none come in that time.
    """
    terminal = Terminal(comm)

    def watch() -> None:
        try:
            Follower(Path(results), terminal, lambda: plot(results, output), wait).follow()
        finally:
            terminal.clear()

    on_rank0(comm, watch)
    return SOLVED


def draw(comm: MPI.Intracomm, command: str, results: str, output: str | None) -> int:
    """Draw pictures or an animation of results on rank 0. Collective.

    Args:
        comm: The ranks; the others wait.
        command: "plot" or "animate".
        results: Folder of the results.
        output: Where the pictures go, or the animation; by default to the results.

    Raises:
        InputError: If there are no results, or nothing can be drawn.
    """
    terminal = Terminal(comm)

    def write() -> None:
        terminal.status("drawing")
        try:
            {"plot": plot, "animate": animate}[command](results, output, terminal.say)
        finally:
            terminal.clear()

    on_rank0(comm, write)
    return SOLVED


def report(comm: MPI.Intracomm, folders: Sequence[str], output: str | None) -> int:
    """Write a page about a run, or about two beside each other, on rank 0. Collective.

    Args:
        comm: The ranks; the others wait.
        folders: Of the results, one or two.
        output: The page; by default in the first of them.

    Raises:
        InputError: If there are no results, or not one or two folders.
    """
    terminal = Terminal(comm)

    def write() -> None:
        terminal.status("writing the page")
        try:
            one = len(folders) == 1
            page = write_report(folders[0], output) if one else write_beside(folders, output)
            terminal.say(str(page))
        finally:
            terminal.clear()

    on_rank0(comm, write)
    return SOLVED


def export_results(comm: MPI.Intracomm, results: str, output: str | None, kinds: set[str]) -> int:
    """Write fields and tables for other programs, by rank 0. Collective.

    Args:
        comm: The ranks; the others wait.
        results: Folder of the results.
        output: For the files; by default in the results.
        kinds: What to write, "vtu" and "csv"; both if empty.

    Raises:
        InputError: If there are no results, they cannot be read, or the files not be written.
    """
    terminal = Terminal(comm)
    wanted = {kind: kind in kinds or not kinds for kind in ("vtu", "csv")}
    on_rank0(comm, lambda: export(results, output, **wanted, say=terminal.say))
    return SOLVED


def _command(comm: MPI.Intracomm, arguments: Sequence[str]) -> int:
    chosen = read_arguments(comm, arguments)
    if chosen.command in ("run", "sweep"):
        steps_shown = chosen.log_level in ("debug", "info")  # and no live line between them
        live = False if steps_shown else None
        terminal = Terminal(comm, live=live, quiet=chosen.quiet)
        with logged_to_console(comm, chosen.log_level, terminal.clear):
            where = (chosen.case, chosen.restart or chosen.output, chosen.force)
            restart = chosen.restart is not None
            how = (chosen.log_level, restart, chosen.report, chosen.trust)
            try:
                if chosen.command == "sweep":
                    return sweep(comm, *where, terminal, chosen.vary, *how)
                if chosen.refine:
                    flags = (chosen.log_level, chosen.report, chosen.trust)
                    return run_refined(comm, *where, terminal, *flags)
                case = read_case(chosen.case, comm, chosen.trust)
                if case.combinations:
                    return run_combined(comm, case, *where[1:], terminal, *how)
                return run(comm, *where, terminal, *how)
            finally:
                terminal.clear()
    with logged_to_console(comm):
        if chosen.command == "check":
            return check(comm, chosen.case, chosen.trust)
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
            glued = Glued.ALL if chosen.tied else Glued.BOLTS if chosen.bolted else Glued.NOTHING
            where = (chosen.geometry, chosen.output, meshing_options(chosen))
            mesh(comm, *where, chosen.material, glued, chosen.force, chosen.trust)
            return SOLVED
        if chosen.command == "export":
            kinds = {kind for kind in ("vtu", "csv") if getattr(chosen, kind)}
            return export_results(comm, chosen.results, chosen.output, kinds)
        if chosen.command == "report":
            return report(comm, chosen.results, chosen.output)
        if chosen.command == "plot" and chosen.follow:
            return follow(comm, chosen.results, chosen.output, chosen.wait)
        return draw(comm, chosen.command, chosen.results, chosen.output)


if __name__ == "__main__":
    sys.exit(main())
