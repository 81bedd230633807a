"""A run: a case is solved level by level, and what comes out is written and shown."""

import time
from typing import Any

from mpi4py import MPI

from dolfinx import fem

from perfplast_fenicsx import __version__
from perfplast_fenicsx.case import Case, read_case
from perfplast_fenicsx.control import WorkControl
from perfplast_fenicsx.limit_load import LimitLoad, limit_load
from perfplast_fenicsx.loading import load_path
from perfplast_fenicsx.logs import RunLog
from perfplast_fenicsx.model import write_model
from perfplast_fenicsx.output import ResultFolder, Results
from perfplast_fenicsx.plotting import dissipation, draw_fields, draw_path
from perfplast_fenicsx.problem import Problem
from perfplast_fenicsx.recovery import Recovery
from perfplast_fenicsx.state import Iteration, Level
from perfplast_fenicsx.terminal import Terminal, describe
from perfplast_fenicsx.xdmf import FieldsFile

SOLVED, FAULT, BAD_INPUT, NO_SOLUTION = range(4)
"""Exit statuses of the command line."""

PRESCRIBED = {"load": "zeta", "work": "alpha"}
"""What each control prescribes; the time of the fields' file."""

LIMIT_KEYS = ("lower", "estimate", "upper", "alpha", "levelled_off", "reason", "linear_solves")
"""Keys of ``limit`` in ``summary.json``."""


def run(
    comm: MPI.Intracomm,
    path: str,
    output: str,
    force: bool,
    terminal: Terminal,
    log_level: str = "info",
) -> int:
    """Solve a case and write its results. Collective.

    Args:
        comm: The ranks.
        path: Case file.
        output: Result folder.
        force: Replace results in it.
        terminal: What is shown.
        log_level: What is in ``run.log`` beside what always is (:class:`logs.RunLog`).

    Returns:
        :data:`SOLVED`, or :data:`NO_SOLUTION` where a level has none.

    Raises:
        InputError: If the case or the folder cannot be used.
    """
    began = time.perf_counter()
    case = read_case(path, comm)
    folder = ResultFolder(comm, output, force)
    terminal.status("setting up the problem")
    problem = case.problem(comm)
    solver = case.solver(problem)
    folder.create()
    with RunLog(folder, log_level) as journal:
        return _solve(case, problem, solver, folder, terminal, journal, began)


def _solve(
    case: Case,
    problem: Problem,
    solver: Any,
    folder: ResultFolder,
    terminal: Terminal,
    journal: RunLog,
    began: float,
) -> int:
    journal.header(case, describe(case.title, case.method, problem))
    model_file = folder.file("model.json")
    folder.on_root(lambda: write_model(case.model, problem.assembly, model_file))
    results = Results(folder, problem, case.title, __version__, case.method)
    timings = results.summary.timings
    timings["setup"] = time.perf_counter() - began
    terminal.header(case.title, case.method, problem)
    terminal.status("level 1")
    recovery = Recovery(problem)
    fields_file = FieldsFile(folder, problem.assembly) if case.output.fields else None
    last: Level | None = None

    def monitor(record: Iteration) -> None:
        terminal.iteration(record)
        journal.iteration(record)

    def accept(level: Level) -> None:
        nonlocal last
        terminal.level(level.report)
        journal.level(level.report)
        with results.timed("output"):
            if level.report.converged:
                last = level
                if fields_file is not None:
                    time_ = getattr(level.report, PRESCRIBED[solver.control])
                    fields_file.write(recovery.update(level.state), time_)
            timings["total"] = time.perf_counter() - began
            results.add(level.report)
        terminal.status(f"level {len(results.reports) + 1}")

    limit = None
    with results.timed("solve"):
        if isinstance(case.loading, WorkControl) and case.loading.limit_tolerance is not None:
            tolerance = case.loading.limit_tolerance
            limit = limit_load(problem, tolerance, solver, monitor, accept)
            terminal.limit(limit)
            journal.limit(limit)
        else:
            for level in load_path(solver, case.loading.values or [], monitor):
                accept(level)
    timings["solve"] -= timings.get("output", 0.0)
    if limit is not None:
        with results.timed("output"):
            results.summary.limit = {key: getattr(limit, key) for key in LIMIT_KEYS}
            if case.output.fields:
                mechanism = FieldsFile(folder, problem.assembly, "mechanism.xdmf")
                work = dissipation(problem, limit.mechanism)
                fields = {"mechanism": limit.mechanism, "dissipation": work}
                mechanism.write(fields, limit.alpha)
    if case.output.pictures and last is not None:
        terminal.status("drawing pictures")
        with results.timed("pictures"):
            _draw(case, problem, recovery, last, results, limit)
    timings["total"] = time.perf_counter() - began
    results.write()
    terminal.results(folder)
    solved = all(report.converged for report in results.reports)
    return SOLVED if solved and (limit is None or limit.levelled_off) else NO_SOLUTION


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
