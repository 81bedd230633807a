"""Loading: a sequence of levels, each started from those before.

:func:`load_path` follows given values of ζ or α; :func:`work_path` chooses the steps in α itself,
from the elastic slope to the plateau of ζ(α).
"""

import logging
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from dolfinx import fem

from perfplast_fenicsx.problem.prescribed import Prescribed
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.problem.state import Level, State
from perfplast_fenicsx.solvers.level_solver import LevelSolver
from perfplast_fenicsx.solvers.newton_options import Monitor
from perfplast_fenicsx.solvers.work_newton import WorkNewton

LARGEST_FACTOR = 4.0
"""α grows at most so much from one level to the next."""

FIRST_FACTOR = 3.0
"""Growth of α behind first yield, and the most where ζ(α) bends."""

SMALLEST_FACTOR = 1.2
"""Growth of α behind levels that were hard to solve."""

MANY_ITERATIONS = 20
"""Levels that need more Newton steps make the next growth smaller."""

BENT, STRAIGHT = 0.08, 0.02
"""Growth of ζ in a level above which steps in α shrink, and below which they grow."""

MOST_HALVINGS = 6
"""A level is tried again with half the step so many times."""

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Reached:
    """How far a loading by chosen steps has come: all that its next step depends on.

    Attributes:
        last: State of the last level.
        before: State of the level before it; None behind the first one.
        newton_iterations: Steps that the last level took.
        rest: α at ζ = 0, where something else than ζ loads the bodies.
    """

    last: State
    before: State | None
    newton_iterations: int
    rest: float = 0.0


def rests_first(solver: LevelSolver, values: Sequence[float]) -> bool:
    """Whether a path begins with ζ = 0 without being told: where loads are constant. Collective."""
    told = solver.prescribes is Prescribed.LOAD_FACTOR and len(values) > 0 and values[0] == 0
    return not told and not solver.problem.loads.is_proportional()


@dataclass(frozen=True)
class Leap:
    """A step as far as one likes, along a velocity that costs no more load.

    Attributes:
        alpha: The work to be reached.
        velocity: v with L(v) = 1.
    """

    alpha: float
    velocity: fem.Function


Ahead = Callable[[Reached], Leap | None]
"""Whoever knows a collapse mechanism tells of a leap; collective."""


def load_path(
    solver: LevelSolver,
    values: Sequence[float],
    monitor: Monitor | None = None,
    start: State | None = None,
) -> Iterator[Level]:
    """Solve for each prescribed value in turn, each from the one before. Collective.

    Where loads are constant the first level is ζ = 0, which tells whether the bodies carry them.

    Args:
        solver: One of the four algorithms.
        values: Load parameters ζ or works α, rising or falling, as the solver prescribes.
        monitor: Called on every rank after each iteration.
        start: State to begin with; None for the unloaded one.

    Yields:
        The levels. One that has not converged is the last: the state of the level before is the
        last valid one.
    """
    if start is None and rests_first(solver, values):
        level = solver.at_rest(monitor)
        yield level
        if not level.report.converged:
            return
        start = level.state
    for value in values:
        level = solver.solve(value, start, monitor)
        yield level
        if not level.report.converged:
            return
        start = level.state


def work_path(
    solver: WorkNewton,
    monitor: Monitor | None = None,
    reached: Reached | None = None,
    ahead: Ahead | None = None,
) -> Iterator[Level]:
    """Load by work without end, from first yield on; the caller stops it. Collective.

    Where supports move or loads are constant the first level is ζ = 0, and the steps are in α − α₀.

    α grows by a factor that shrinks where ζ(α) bends or a level has needed many steps, and grows
    on the plateau. Each level starts from the extrapolation of the two before, or goes along a
    mechanism. A level that fails is tried again with half the step.

    Args:
        solver: ALG3 or ALG4.
        monitor: Called on every rank after each iteration.
        reached: Where to go on; None from first yield on.
        ahead: Asked for a leap before each step but the first.

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
    if reached is None:
        elastic = solver.first_yield()
        target, start = elastic.alpha, None if problem.has_gaps else elastic
    while True:
        if reached is not None:
            before, last, rest = reached.before, reached.last, reached.rest
            leap = ahead(reached) if ahead is not None else None
            if leap is not None:
                target = leap.alpha
            elif from_rest and before is None:
                target, before = rest + solver.first_step(last), last
            else:
                target = rest + (last.alpha - rest) * _next_factor(reached)
            start = _start(problem, before, last, leap, target)
        for halving in range(MOST_HALVINGS + 1):
            level = solver.solve(target, start, monitor)
            if level.report.converged or halving == MOST_HALVINGS:
                break
            log.info("alpha = %.6g failed (%s): half the step", target, level.report.reason)
            target = _nearer(target, last.alpha if last else rest, rest)
            start = _start(problem, before, last, leap, target)
        yield level
        if not level.report.converged:
            return
        reached = Reached(level.state, last, level.report.newton_iterations, rest)


def _next_factor(reached: Reached) -> float:
    last, before = reached.last, reached.before
    if before is None or before.alpha <= reached.rest:
        return FIRST_FACTOR
    factor = (last.alpha - reached.rest) / (before.alpha - reached.rest)
    bend = 1 - before.zeta / last.zeta if last.zeta > 0 else 1.0
    if reached.newton_iterations > MANY_ITERATIONS:
        return max(math.sqrt(factor), SMALLEST_FACTOR)
    if bend > BENT:
        return max(min(factor, FIRST_FACTOR), SMALLEST_FACTOR)
    return min(factor * (2.0 if bend < STRAIGHT else 1.2), LARGEST_FACTOR)


def _nearer(target: float, alpha: float, rest: float) -> float:
    """Half the step; of a leap half the powers of ten."""
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


def extrapolate(
    problem: Problem, before: State | None, last: State | None, alpha: float
) -> State | None:
    """The state at a work α on the line through two states (the first may be the unloaded one).

    Its active set and history are those of the last level.
    """
    earlier = (before.u.x.array, before.alpha) if before else (0.0, 0.0)
    if last is None or last.alpha <= earlier[1]:
        return last
    stretch = (alpha - last.alpha) / (last.alpha - earlier[1])
    u = fem.Function(problem.V, name="displacement")
    u.x.array[:] = last.u.x.array + stretch * (last.u.x.array - np.asarray(earlier[0]))
    return State(u, last.zeta, alpha, last.active, last.history)
