"""A run: a case is solved level by level, and what comes out is written and shown."""

import logging
import time
from typing import Any

from mpi4py import MPI

from dolfinx import fem

from perfplast_fenicsx._version import __version__
from perfplast_fenicsx.cli.recorder import Recorder
from perfplast_fenicsx.cli.run_log import RunLog
from perfplast_fenicsx.cli.signals import Interrupted, Interrupts
from perfplast_fenicsx.cli.terminal import Terminal, describe
from perfplast_fenicsx.io.case.case import Case, read_case
from perfplast_fenicsx.io.case.loading_options import WorkControl
from perfplast_fenicsx.io.case.scene import write_scene
from perfplast_fenicsx.io.results.checkpoint_header import check_case
from perfplast_fenicsx.io.results.checkpoints import Checkpoints, Saved
from perfplast_fenicsx.io.results.output_fields import dissipation
from perfplast_fenicsx.io.results.result_folder import ResultFolder
from perfplast_fenicsx.limit_analysis.limit_search import LimitLoad, limit_load
from perfplast_fenicsx.pictures.run_figures import draw_fields, draw_path, mechanism_caption
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.solvers.load_stepping import load_path

SOLVED, FAULT, BAD_INPUT, NO_SOLUTION = range(4)
"""Exit statuses of the command line; an interrupted run has that of :class:`Interrupted`."""

LIMIT_KEYS = ("lower", "estimate", "upper", "alpha", "levelled_off", "reason", "linear_solves")
"""Keys of ``limit`` in ``summary.json``."""

log = logging.getLogger(__name__)


def run(
    comm: MPI.Intracomm,
    path: str,
    output: str,
    force: bool,
    terminal: Terminal,
    log_level: str = "info",
    restart: bool = False,
) -> int:
    """Solve a case and write its results. Collective.

    Args:
        comm: The ranks.
        path: Case file.
        output: Result folder.
        force: Replace results in it.
        terminal: What is shown.
        log_level: What is in ``run.log`` beside what always is (:class:`run_log.RunLog`).
        restart: Go on from the last level that is solved in the folder.

    Returns:
        :data:`SOLVED`, :data:`NO_SOLUTION` where a level has none, or the status of an interrupt.

    Raises:
        InputError: If the case or the folder cannot be used.
    """
    began = time.perf_counter()
    with Interrupts(comm) as interrupts:
        case = read_case(path, comm)
        folder = ResultFolder(comm, output, force, restart)
        if restart:
            check_case(folder, case.table, case.path.name)
        terminal.status("setting up the problem")
        problem = case.problem(comm)
        solver = case.solver(problem)
        checkpoints = Checkpoints(folder, problem, case.table, __version__)
        saved = checkpoints.read() if restart else Saved()
        if not restart:
            folder.create()
            checkpoints.write(saved)
        with RunLog(folder, log_level, len(saved.reports) + 1) as journal:
            journal.header(case, describe(case.title, case.method, problem))
            try:
                about = (case, problem, folder, checkpoints, saved, terminal, journal, interrupts)
                return _solve(case, solver, Recorder(*about, began), terminal, journal)
            except Interrupted as interrupted:
                log.warning(
                    "interrupted by %s, what is solved is on file; go on with:"
                    " perfplast run %s --restart %s",
                    *(interrupted, path, output),
                )
                return interrupted.status


def _solve(case: Case, solver: Any, recorder: Recorder, terminal: Terminal, journal: RunLog) -> int:
    problem: Problem = solver.problem
    results, saved = recorder.results, recorder.saved
    folder, timings = results.folder, results.summary.timings
    model_file = folder.file("scene.json")
    folder.on_root(lambda: write_scene(case.model, problem.tagged_mesh, model_file))
    limit = None
    if isinstance(case.loading, WorkControl) and case.loading.limit_tolerance is not None:
        tolerance = case.loading.limit_tolerance
        limit = limit_load(
            *(problem, tolerance, solver),
            monitor=recorder.iteration,
            on_level=recorder.level,
            search=saved.search,
            reached=saved.reached,
        )
        terminal.limit(limit)
        journal.limit(limit)
    else:
        values = (case.loading.values or [])[len(saved.reports) :]
        start = saved.level.state if saved.level else None
        for level in load_path(solver, values, recorder.iteration, start):
            recorder.level(level)
    if limit is not None:
        with results.timed("output"):
            results.summary.limit = {key: getattr(limit, key) for key in LIMIT_KEYS}
            if recorder.fields is not None:
                mechanism, work = limit.mechanism, dissipation(problem, limit.mechanism)
                recorder.fields.write_mechanism(mechanism, work, limit.lower, limit.alpha)
    if case.output.pictures and recorder.last is not None:
        terminal.status("drawing pictures")
        with results.timed("pictures"):
            _draw(case, problem, recorder, limit)
    timings["total"] = recorder.elapsed()
    results.write()
    terminal.results(folder)
    solved = all(report.converged for report in results.reports)
    return SOLVED if solved and (limit is None or limit.levelled_off) else NO_SOLUTION


def _draw(case: Case, problem: Problem, recorder: Recorder, limit: LimitLoad | None) -> None:
    results, last = recorder.results, recorder.last
    assert last is not None
    folder, report = results.folder, last.report

    def draw(fields: dict[str, fem.Function], name: str, caption: str | None = None) -> None:
        about = (report, case.title, case.loads, case.contacts)
        path = folder.file(name)
        draw_fields(problem.tagged_mesh, fields, *about, path, caption, case.obstacles, case.units)

    fields = recorder.recovery.update(last)
    draw(fields, "fields.png")
    if limit is not None:
        work = dissipation(problem, limit.mechanism)
        mechanism = fields | {"displacement": limit.mechanism, "dissipation": work}
        draw(mechanism, "mechanism.png", mechanism_caption(limit.lower))
    path = folder.file("path.png")
    unit = case.units.of_work(problem.tagged_mesh.mesh.geometry.dim)
    folder.on_root(lambda: draw_path(results.reports, case.title, path, limit, unit))
