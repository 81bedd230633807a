"""Run a case: set up the problem, solve it, and write and show the results."""

import logging
import shlex
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np

from perfplast_fenicsx._version import __version__
from perfplast_fenicsx.cli.parser import NO_SOLUTION, SOLVED
from perfplast_fenicsx.cli.recorder import Recorder, RunContext, bolt_lines
from perfplast_fenicsx.cli.run_log import RunLog, kept_warnings
from perfplast_fenicsx.cli.signals import Interrupted, Interrupts
from perfplast_fenicsx.cli.terminal import Terminal, describe
from perfplast_fenicsx.cli.understood import understood
from perfplast_fenicsx.controls.control import Run
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.io.case.case import Case
from perfplast_fenicsx.io.case.case_reader import read_case
from perfplast_fenicsx.io.case.load_table import meaning
from perfplast_fenicsx.io.case.schema import at
from perfplast_fenicsx.io.case.units_table import odd_magnitudes
from perfplast_fenicsx.io.results.checkpoints import Checkpoints, Saved, check_case, with_contents
from perfplast_fenicsx.io.results.proof_file import read_proven
from perfplast_fenicsx.io.results.result_files import INTERRUPTED, KNOWN
from perfplast_fenicsx.io.results.result_folder import ResultFolder
from perfplast_fenicsx.limit_analysis.blocks.rigid_blocks import are_blocks
from perfplast_fenicsx.limit_analysis.body.adaptive_meshes import AdaptiveBounds
from perfplast_fenicsx.limit_analysis.body.safety_factor import FactorOfSafety
from perfplast_fenicsx.limit_analysis.conic.conic_solver import (
    USUAL,
    check_solver,
    conic_solver,
)
from perfplast_fenicsx.limit_analysis.discrete.discrete_limit import drucker_bounds
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitLoad, LimitMethod, method_for
from perfplast_fenicsx.materials.nonassociated_flow import flow_words
from perfplast_fenicsx.pictures.drawing_process import draw
from perfplast_fenicsx.problem.contact_check import left_out
from perfplast_fenicsx.problem.history.loading_history import LoadingHistory
from perfplast_fenicsx.problem.judged.oblique_facets import interlocked
from perfplast_fenicsx.problem.judged.state import check_slip_is_true
from perfplast_fenicsx.problem.problem import Problem, halved, variant
from perfplast_fenicsx.report.report_file import LiveReport, Reporting, report_on

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Flags:
    """Options that ``run`` and ``sweep`` share.

    Attributes:
        force: Whether to replace existing results in the folder.
        restart: Whether to continue from the last solved level in the folder.
        report: When to write ``report.html``; it is also written if a signal ends the run.
        trust: Whether to run a script that makes the mesh.
        log_level: Lowest level of the additional lines in ``run.log``; see :class:`run_log.RunLog`.
    """

    force: bool = False
    restart: bool = False
    report: Reporting = Reporting.NEVER
    trust: bool = False
    log_level: str = "info"


@dataclass(frozen=True, eq=False)
class OneOfSeveral:
    """One of several cases that the program makes from one case file.

    Attributes:
        case: The case.
        command: The command that repeats the runs of all these cases.
        bodies: Problem whose mesh and contacts this case shares; None if the case has its own.
    """

    case: Case
    command: str
    bodies: Problem | None = None


def run(
    comm: MPI.Intracomm,
    path: str,
    output: str,
    terminal: Terminal,
    flags: Flags,
    one: OneOfSeveral | None = None,
    finer: bool = False,
) -> int:
    """Solve a case and write its results. Collective.

    Args:
        comm: The ranks of the run.
        path: Path of the case file.
        output: Result folder.
        terminal: The terminal that shows the run.
        flags: Options of the command.
        one: The case, if it is one of several from the same file.
        finer: Whether to halve the size of the elements.

    Returns:
        ``SOLVED``; ``NO_SOLUTION`` without a level or limit load; or the status of an interrupt.

    Raises:
        InputError: If the case or the folder cannot be used.
    """
    began, date = time.perf_counter(), time.strftime("%Y-%m-%d %H:%M %Z")
    with Interrupts(comm) as interrupts, kept_warnings(comm) as warnings:
        case = one.case if one else read_case(path, comm, flags.trust)
        if case.combinations:
            raise InputError(
                f"{case.path.name}: the case has combinations, but --refine solves only one case; "
                "remove --refine or the combinations."
            )
        folder = ResultFolder(comm, output, flags.force, flags.restart)
        content = with_contents(case.table, case.materials)
        if flags.restart:
            check_case(folder, content, case.path.name)
        terminal.status("setting up the problem")
        problem = _problem(comm, case, one.bodies if one else None, finer)
        checkpoints = Checkpoints(folder, problem, content, __version__)
        stages = case.history(problem)
        saved = checkpoints.read(stages) if flags.restart else Saved()
        method = case.method if saved.reports else case.method_on(problem)
        solver = admitted_solver(case, problem, method)
        if not flags.restart:
            folder.create()
            checkpoints.write(saved)
        whole = str(Path(output).parent) if one else output
        with RunLog(folder, flags.log_level, len(saved.reports) + 1) as journal:
            repeat = one.command if one else run_command(path, whole, flags.report, flags.trust)
            context = RunContext(
                case=case,
                problem=problem,
                method=method,
                folder=folder,
                checkpoints=checkpoints,
                saved=saved,
                terminal=terminal,
                journal=journal,
                interrupts=interrupts,
                began=began,
                date=comm.bcast(date),
                command=repeat,
                remarks=_introduce(case, problem, method, terminal, journal),
                warnings=warnings,
                live=LiveReport(folder) if flags.report is Reporting.LIVE else None,
            )
            try:
                status = _solve(context, solver, stages)
            except Interrupted as interrupted:
                again = one.command.replace(" -o ", " --restart ", 1) if one else ""
                again = again or f"perfplast run {path} --restart {whole}"
                _log_interrupt(interrupted, solver or folder.file(KNOWN).exists(), again)
                status = interrupted.status
            finally:
                terminal.heard = None  # the report is written once more below
            if flags.report and (page := report_on(folder)) is not None:
                terminal.say(f"Report: {page}")
            return status


def _log_interrupt(interrupted: Interrupted, kept: Any, again: str) -> None:
    """Log an interruption, with the command that continues the run or starts it again."""
    words = "solved levels are saved; continue" if kept else "no results are lost; start again"
    log.warning("%s %s: %s with: %s", INTERRUPTED, interrupted, words, again)


def _introduce(
    case: Case, problem: Problem, method: str, terminal: Terminal, journal: RunLog
) -> list[str]:
    """Print a description of a case, and return the remarks on the case. Collective."""
    said = [*case.remarks]
    if not case.loading.of_body:  # bounds print their own sentence on the flow rule
        said += flow_words(case.materials)
    if method == LimitMethod.INTERIOR_POINT:
        said += case.loading.remarks(problem)
    else:
        said += _on_friction(problem, case.loading.limit_tolerance is not None)
        said += problem.shanks.in_words()
    meant = understood(case, problem)
    lines = meant.lines if meant else []  # only rank 0 has and prints these lines
    terminal.say("\n".join(lines))
    for remark in said:
        terminal.say(f"{remark}.")
    warn_of(problem.comm, case, problem)
    remarks = [*problem.constraints.remarks, *left_out(problem), *said]
    heading = describe(case.title, method, problem, case.options, case.conic)
    journal.header(case, [*lines, heading, *remarks])
    return remarks


def admitted_solver(case: Case, problem: Problem, method: str) -> Any:
    """Return the algorithm that solves a problem, after all tests that need no solution.

    Collective.

    Both ``check`` and ``run`` call this function. So ``check`` finds every error that ``run`` would
    report before its first solve, except a lack of memory.

    Args:
        case: The case.
        problem: Problem of the case.
        method: Name of the method in results.

    Returns:
        The algorithm of ``[solve]``; None for the interior point method.

    Raises:
        InputError: If the control or the solver of conic programs cannot be used for the problem.
    """
    direct = method == LimitMethod.INTERIOR_POINT
    with at(case.path.name):
        if not direct:
            check_slip_is_true(problem)
        check_conic(case, problem, direct)
        solver = None if direct else case.solver(problem)
        case.loading.admit(problem, solver)
    return solver


def check_conic(case: Case, problem: Problem, direct: bool) -> None:
    """Raise an error if the given solver of conic programs cannot run or is not needed.

    Args:
        case: Case of the problem.
        problem: The bodies and their loads.
        direct: Whether the interior point method solves the problem.

    Raises:
        InputError: If the solver is not the default solver and cannot run or is not needed.
    """
    if case.conic == USUAL:
        return
    if not direct or are_blocks(problem):
        how = "of rigid blocks" if direct else "along a path"
        raise InputError(
            f"[solve], conic = '{case.conic}' selects a solver of conic programs, but a limit load "
            f"{how} needs no such program; remove conic."
        )
    check_solver(case.conic, problem.comm.size)


def _problem(comm: MPI.Intracomm, case: Case, bodies: Problem | None, finer: bool) -> Problem:
    """Return the problem of a case, on the given bodies or on a new mesh. Collective."""
    problem = case.problem(comm) if bodies is None else on_bodies(bodies, case)
    if not finer:
        return problem
    with at(f"{case.path.name}, --refine"):
        return halved(problem)


def on_bodies(bodies: Problem, case: Case) -> Problem:
    """Return the problem of a case on the mesh and contacts of another problem. Collective."""
    with at(f"{case.path.name}, {case.remarks[-1]}"):
        return variant(bodies, materials=case.materials, loads=case.loads_on(bodies))


def run_command(path: str, output: str, report: Reporting, trust: bool) -> str:
    """Return the shell command that repeats the run."""
    flags = [flag for flag in ("--trust" if trust else "", report) if flag]
    return shlex.join(["perfplast", "run", path, "-o", output, *flags])


def warn_of(comm: MPI.Intracomm, case: Case, problem: Problem) -> None:
    """Log warnings about suspicious data in a valid case. Collective."""
    points = problem.tagged_mesh.mesh.geometry.x
    places = np.asarray(points, dtype=np.float64)
    odd = odd_magnitudes(case.units, case.materials, case.loads, comm, places)
    slides = [remark] if (remark := interlocked(problem)) else []
    for remark in (*problem.tagged_mesh.remarks, *odd, *slides):
        if comm.rank == 0:
            log.warning("%s", remark)


def _on_friction(problem: Problem, searched: bool) -> list[str]:
    """Return sentences on Coulomb's friction, with Drucker's bounds if they apply. Collective.

    If the run searches for a limit load, these bounds are not included: they are printed with the
    limit load.
    """
    if not problem.friction.follows_pressure:
        return []
    step = "a step from the previous level" if problem.in_stages else "one step"
    told = [f"Coulomb's friction: each level is {step}, whose solution need not be unique"]
    bounded = not problem.loads.has_dead() and not searched
    if bounded and method_for(problem) is LimitMethod.INTERIOR_POINT:
        told.append(drucker_bounds(problem).in_words())
    return told


def _asked(
    context: RunContext, solver: Any, stages: LoadingHistory | None, recorder: Recorder
) -> Run:
    """Return the objects that the control of a case needs for its run."""
    saved, directions = context.saved, read_proven(context.folder, again=True)
    if directions:
        context.terminal.say(
            f"Directions already proven: {len(directions)}; the last is computed again."
        )
    return Run(
        problem=context.problem,
        solver=solver,
        record=recorder,
        adapt=context.case.adapt,
        history=stages,
        start=saved.level.state if saved.level else None,
        before=saved.before,
        done=len(saved.reports),
        search=saved.search,
        reached=saved.reached,
        directions=directions,
    )


def _is_on(problem: Problem, found: LimitLoad) -> bool:
    return found.mechanism.function_space.mesh is problem.tagged_mesh.mesh


def _solve(context: RunContext, solver: Any, stages: LoadingHistory | None) -> int:
    case, recorder = context.case, Recorder(context)
    try:
        with at(case.path.name):
            asked = _asked(context, solver, stages, recorder)
            with conic_solver(case.conic):
                limit = case.loading.find(asked)
    except Interrupted as interrupted:
        adapted, found, safety = interrupted.adapted, interrupted.found, interrupted.safety
        if isinstance(safety, FactorOfSafety) or case.loading.divides:
            recorder.interrupted_safety(safety if isinstance(safety, FactorOfSafety) else None)
        elif isinstance(adapted, AdaptiveBounds):
            recorder.limit(adapted.best.mesh, adapted.body, adapted)
        elif isinstance(found, LimitLoad) and _is_on(context.problem, found):
            recorder.limit(found)
        raise
    results = recorder.results
    if case.output.pictures and (recorder.last is not None or (limit and limit.collapses)):
        context.terminal.status("drawing pictures")
        if not case.output.fields:
            log.info("only path.png is drawn: fields.png needs fields = true under [output]")
        with results.timed("pictures"):
            draw(context.folder)
    if recorder.last is not None:
        told = (results.summary.limit or {}).get("forces") or {}
        if told.get("zeta") != recorder.last.report.zeta:
            context.terminal.reactions(recorder.last.report, context.problem, case.units)
        unit = case.units.table(context.problem.kinematics.whole)["force"]
        for line in bolt_lines(results.reports, unit):
            context.terminal.say(line)
    for text in meaning(case, context.problem.kinematics.whole):
        context.terminal.say(text)
    results.summary.timings["total"] = recorder.elapsed()
    results.write()
    context.terminal.results(context.folder, goes_on=bool(results.reports))
    solved = all(report.converged for report in results.reports)
    return SOLVED if solved and (limit is None or limit.levelled_off) else NO_SOLUTION
