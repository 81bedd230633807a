"""Load the bodies by a sequence of levels, each started from previous ones.

:func:`load_path` follows given values of ζ or α; :func:`work_path` chooses its own steps in α, from
the elastic slope to the plateau of ζ(α).
"""

import dataclasses
import logging
import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from dolfinx import fem

from perfplast_fenicsx.problem.declared.prescribed import Prescribed
from perfplast_fenicsx.problem.judged.state import Level, State
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.solvers.contact_solver import counts
from perfplast_fenicsx.solvers.level_solver import LevelSolver
from perfplast_fenicsx.solvers.newton_options import Monitor
from perfplast_fenicsx.solvers.next_work import LARGEST_FACTOR, Leap, Reached, next_work
from perfplast_fenicsx.solvers.work_newton import WorkNewton

MOST_HALVINGS = 6
"""Number of times that a failed step is halved."""

log = logging.getLogger(__name__)


def rests_first(solver: LevelSolver, values: Sequence[float]) -> bool:
    """Return whether a path begins with ζ = 0 although its values do not. Collective.

    This is the case with constant loads or with bolts.
    """
    told = solver.prescribes is Prescribed.LOAD_FACTOR and len(values) > 0 and values[0] == 0
    problem = solver.problem
    return not told and (bool(problem.shanks.bolts) or problem.loads.has_dead())


Ahead = Callable[[Reached], Leap | None]
"""Function that returns a leap if a collapse mechanism is known; collective."""


def load_path(
    solver: LevelSolver,
    values: Sequence[float],
    monitor: Monitor | None = None,
    start: State | None = None,
    before: State | None = None,
) -> Iterator[Level]:
    """Solve for each prescribed value in turn, starting on the line through the previous two.

    Collective.

    The first level is ζ = 0 if loads are constant or bolts are tightened; it shows whether the
    bodies carry them. If only ζ loads bodies without gaps, the unloaded state is on the line as
    well. Elastic levels are then multiples of each other.

    Args:
        solver: One of the four algorithms.
        values: Load parameters ζ or works α, increasing or decreasing, as the solver prescribes.
        monitor: Called on every rank after each iteration.
        start: Initial state; None for the unloaded one.
        before: State of the level before ``start``, if there is one.

    Yields:
        The levels. A level that has not converged is the last one; the level before it has the last
        valid state.
    """
    if start is None and rests_first(solver, values):
        level = solver.at_rest(monitor)
        yield level
        if not level.report.converged:
            return
        start = level.state
    for value in values:
        level = solver.solve(value, _along(solver, before, start, value), monitor)
        yield level
        if not level.report.converged:
            return
        before, start = start, level.state


def work_path(
    solver: WorkNewton,
    monitor: Monitor | None = None,
    reached: Reached | None = None,
    ahead: Ahead | None = None,
) -> Iterator[Level]:
    """Load by work without end, from first yield on; the caller ends the iteration. Collective.

    With moving supports or constant loads the first level is ζ = 0, and the steps are in α − α₀.

    α grows by a factor that decreases where ζ(α) bends or a level needs many steps, and increases
    on the plateau. Each level starts from the extrapolation of the previous two, or follows a
    mechanism. A failed level is tried again with half the step.

    Args:
        solver: ALG3 or ALG4.
        monitor: Called on every rank after each iteration.
        reached: Progress to continue from; None to start at first yield.
        ahead: Function that may return a leap before each step but the first.

    Yields:
        The levels; one that has not converged is the last, after the step was halved
        ``MOST_HALVINGS`` times.
    """
    before: State | None = None
    last: State | None = None
    leap: Leap | None = None
    problem, rest = solver.problem, 0.0
    from_rest = not problem.is_elastic_at_first()
    if reached is None and from_rest:
        level = solver.at_rest(monitor)
        yield level
        if not level.report.converged:
            return
        steps, rest = level.report.newton_iterations, level.state.alpha
        reached = Reached(level.state, None, steps, rest)
    began, before_all = time.perf_counter(), counts(solver.linear, solver.program)
    if reached is None:
        elastic = solver.near_yield()
        target, start = elastic.alpha, None if problem.has_gaps else elastic
    while True:
        if reached is not None:
            before, last, rest = reached.before, reached.last, reached.rest
            leap = ahead(reached) if ahead is not None else None
            began, before_all = time.perf_counter(), counts(solver.linear, solver.program)
            if from_rest and before is None and leap is None:
                target, before = rest + solver.first_step(last), last
            else:
                target, before, leap = next_work(problem, reached, leap)
            start = _start(problem, before, last, leap, target)
        for halving in range(MOST_HALVINGS + 1):
            level = solver.solve(target, start, monitor)
            if level.report.converged or halving == MOST_HALVINGS:
                break
            log.info("alpha = %.6g failed (%s): half the step", target, level.report.reason)
            target = _nearer(target, last.alpha if last else rest, rest)
            start = _start(problem, before, last, leap, target)
        level = _with_all(level, solver, time.perf_counter() - began, before_all)
        yield level
        if not level.report.converged:
            return
        reached = Reached(level.state, last, level.report.newton_iterations, rest)


def _with_all(
    level: Level, solver: LevelSolver, seconds: float, before: Mapping[str, Any]
) -> Level:
    """Return a level with its history: the state near first yield, and too long steps."""
    now = counts(solver.linear, solver.program)
    counted = {name: count - before[name] for name, count in now.items()}
    report = dataclasses.replace(level.report, seconds=seconds, **counted)
    return dataclasses.replace(level, report=report)


def _nearer(target: float, alpha: float, rest: float) -> float:
    """Return a target with half the step; for a leap half the powers of ten."""
    a, b = alpha - rest, target - rest
    leaping = 0 < LARGEST_FACTOR * a < b
    return rest + (math.sqrt(a * b) if leaping else (a + b) / 2)


def _start(
    problem: Problem, before: State | None, last: State | None, leap: Leap | None, alpha: float
) -> State | None:
    if leap is None or last is None:
        return extrapolate(problem, before, last, alpha)
    u = fem.Function(problem.V, name="displacement")
    u.x.array[:] = last.u.x.array + (alpha - last.alpha) * leap.velocity.x.array
    return State(u, last.zeta, alpha, last.active, last.history)


def _along(
    solver: LevelSolver, before: State | None, last: State | None, value: float
) -> State | None:
    """Return the start of a level on the line through the previous two."""
    problem, prescribes = solver.problem, solver.prescribes
    if before is None and (problem.has_gaps or not problem.is_elastic_at_first()):
        return last
    # Largest distance of a start on a given path from the last level, in distances of the last two,
    # and from the unloaded state: where bodies yield, the line soon leaves the path.
    longest_line, longest_ray = 1.0, 4.0
    longest = longest_line if before else longest_ray
    return extrapolate(problem, before, last, value, prescribes, longest)


def extrapolate(
    problem: Problem,
    before: State | None,
    last: State | None,
    value: float,
    prescribes: Prescribed = Prescribed.WORK,
    longest: float = math.inf,
) -> State | None:
    """Return the state at a prescribed value on the line through two states.

    Its active set and history are those of the last level.

    Args:
        problem: Problem of the states.
        before: The earlier state; None for the unloaded one.
        last: The later state.
        value: ζ or α.
        prescribes: The prescribed quantity.
        longest: Largest distance from the last state, in distances of the two states.

    Returns:
        The state; the last one itself if the two coincide.
    """
    if last is None:
        return None
    earlier, here = prescribes.of(before) if before else 0.0, prescribes.of(last)
    no_line = 1e-12  # two states whose loads differ by less, relative, coincide
    if abs(here - earlier) <= no_line * max(abs(here), abs(earlier)):
        return last
    stretch = float(np.clip((value - here) / (here - earlier), -longest, longest))
    u = fem.Function(problem.V, name="displacement")
    first = before.u.x.array if before else 0.0
    u.x.array[:] = last.u.x.array + stretch * (last.u.x.array - first)
    alpha = last.alpha + stretch * (last.alpha - (before.alpha if before else 0.0))
    zeta = last.zeta + stretch * (last.zeta - (before.zeta if before else 0.0))
    return State(u, zeta, alpha, last.active, last.history)
