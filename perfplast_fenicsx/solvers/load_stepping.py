"""Solve a sequence of levels, and choose the next step in α or in a prescribed motion.

:func:`load_path` follows given values of ζ or α; :func:`work_path` chooses the steps in α itself,
from the elastic slope to the plateau of ζ(α).

Steps in α end where gaps close. If one body has reached its own limit load, ζ(α) is constant until
a gap closes and another body supports this body. The line through the last two levels predicts
where the gap closes; beyond that point the line no longer approximates ζ(α).

In :func:`work_path`, α grows by a factor that decreases where ζ(α) bends or a level needs many
steps. The factor increases on the plateau, where a collapse mechanism may allow a longer step.
"""

import dataclasses
import logging
import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mpi4py import MPI

import numpy as np
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats, PairFlags
from perfplast_fenicsx.problem.declared.prescribed import Prescribed
from perfplast_fenicsx.problem.judged.state import Level, State
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.solvers.contact_solver import counts
from perfplast_fenicsx.solvers.level_solver import LevelSolver
from perfplast_fenicsx.solvers.newton import WorkNewton
from perfplast_fenicsx.solvers.newton_options import Monitor

log = logging.getLogger(__name__)


def closing_work(problem: Problem, before: State, last: State, alpha: float) -> float:
    """Return the work at which half of the gaps that close before α have closed, or α itself.

    Collective.

    The result is α if the number of pairs that close does not exceed the number of closed pairs. In
    this case contact grows gradually, as between round bodies.

    Args:
        problem: Problem of the states.
        before: State of the level before ``last``.
        last: State of the last level.
        alpha: Work of the next level, larger than the work of the last level.
    """
    if not problem.has_gaps or last.alpha <= before.alpha:
        return alpha
    room, closed = _room(problem, last)
    rate = (_room(problem, before)[0] - room) / (last.alpha - before.alpha)
    open_ones = ~closed & (rate * (alpha - last.alpha) > room)
    when = room[open_ones] / rate[open_ones]
    counts = problem.comm.allreduce(np.array([len(when), np.count_nonzero(closed)]), MPI.SUM)
    if counts[0] <= counts[1]:
        return alpha
    low, high = 0.0, alpha - last.alpha
    # Number of bisections that locate the closing work.
    bisections = 20
    for _ in range(bisections):
        middle = (low + high) / 2
        half = 2 * problem.comm.allreduce(int((when <= middle).sum())) >= counts[0]
        low, high = (low, middle) if half else (middle, high)
    return last.alpha + high


def has_closed(problem: Problem, before: State, last: State) -> bool:
    """Return whether more pairs closed in the last level than were closed before. Collective."""
    if not problem.has_gaps:
        return False
    then, now = (np.count_nonzero(_room(problem, state)[1]) for state in (before, last))
    counts = problem.comm.allreduce(np.array([then, now]), MPI.SUM)
    return bool(counts[1] > 2 * counts[0])


def _room(problem: Problem, state: State) -> tuple[Floats, PairFlags]:
    """Return the current gap g − s of the pairs on this rank, and whether each pair is closed.

    Collective. Both arrays have shape (num_pairs,).
    """
    basis, jumps = problem.basis, problem.create_vector()
    basis.M.mult(state.u.x.petsc_vec, jumps)
    room = basis.gap - jumps.array_r[basis.index]
    jumps.destroy()
    size = np.abs(state.u.x.array).max(initial=0)
    largest = float(problem.comm.allreduce(size, MPI.MAX))
    closed = 1e-9  # a gap below this fraction of the largest displacement is zero
    return room, room <= closed * largest


LARGEST_FACTOR = 4.0
"""Largest growth of α from one level to the next."""


SMALLEST_FACTOR = 1.2
"""Growth of α after levels with many steps."""


@dataclass(frozen=True)
class Reached:
    """Progress of a loading whose steps the program chooses; it determines the next step.

    Attributes:
        last: State of the last level.
        before: State of the level before ``last``; None if there is none.
        newton_iterations: Number of steps in the last level.
        rest: α at ζ = 0, which is not 0 if the bodies are loaded at ζ = 0.
    """

    last: State
    before: State | None
    newton_iterations: int
    rest: float = 0.0


@dataclass(frozen=True)
class Leap:
    """A step of any length along a collapse mechanism at constant load.

    Attributes:
        alpha: The target work.
        velocity: Velocity v of the mechanism, with L(v) = 1.
    """

    alpha: float
    velocity: fem.Function


def next_work(
    problem: Problem, reached: Reached, leap: Leap | None
) -> tuple[float, State | None, Leap | None]:
    """Return the work of the next level, and the data for its start. Collective.

    Args:
        problem: The problem that is loaded.
        reached: Progress of the loading.
        leap: Leap along a mechanism, if one is known; else None.

    Returns:
        The work α; the earlier of the two states whose line gives the start, or the last state if
        the level starts from it; and the leap, or None if a gap closes first.
    """
    last, before, rest = reached.last, reached.before, reached.rest
    if before is not None and has_closed(problem, before, last):
        return rest + (last.alpha - rest) * SMALLEST_FACTOR, last, None
    if leap is not None:
        alpha = leap.alpha
    else:
        alpha = rest + (last.alpha - rest) * _next_factor(reached)
    if before is None:
        return alpha, before, leap
    event = closing_work(problem, before, last, alpha)
    # Smallest factor by which α grows up to a closing gap, so that nearly closed pairs do not stop
    # the path.
    least_factor = 1.02
    event = max(event, min(alpha, rest + (last.alpha - rest) * least_factor))
    return event, before, leap if event >= alpha else None


def _next_factor(reached: Reached) -> float:
    last, before = reached.last, reached.before
    first_factor = 3.0  # growth of α after first yield, and largest growth where ζ(α) bends
    if before is None or before.alpha <= reached.rest:
        return first_factor
    factor = (last.alpha - reached.rest) / (before.alpha - reached.rest)
    bend = 1 - before.zeta / last.zeta if last.zeta > 0 else 1.0
    many_iterations = 20  # levels with more Newton steps reduce the next growth
    if reached.newton_iterations > many_iterations:
        return max(math.sqrt(factor), SMALLEST_FACTOR)
    # Relative growth of ζ in a level above which steps in α decrease, and below which they
    # increase.
    bent, straight = 0.08, 0.02
    if bend > bent:
        return max(min(factor, first_factor), SMALLEST_FACTOR)
    return min(factor * (2.0 if bend < straight else 1.2), LARGEST_FACTOR)


MOST_HALVINGS = 6
"""Number of times that a failed step is halved."""


def rests_first(solver: LevelSolver, values: Sequence[float]) -> bool:
    """Return whether a path first solves ζ = 0 although its values do not begin with ζ = 0.

    Collective.

    This is the case with constant loads or bolts.
    """
    told = solver.prescribes is Prescribed.LOAD_FACTOR and len(values) > 0 and values[0] == 0
    problem = solver.problem
    return not told and (bool(problem.shanks.bolts) or problem.loads.has_dead())


Ahead = Callable[[Reached], Leap | None]
"""Function that returns a leap if it knows a collapse mechanism, else None; collective."""


def load_path(
    solver: LevelSolver,
    values: Sequence[float],
    monitor: Monitor | None = None,
    start: State | None = None,
    before: State | None = None,
) -> Iterator[Level]:
    """Solve a level for each prescribed value, from the line through the previous two levels.

    Collective.

    With constant loads or bolts, the first level is ζ = 0; it shows whether the bodies carry these
    loads. If only ζ loads the bodies and no gaps exist, the line for the second level passes
    through the unloaded state. Elastic levels are then multiples of each other.

    Args:
        solver: One of the four algorithms.
        values: Load factors ζ or works α, whichever the solver prescribes, increasing or
            decreasing.
        monitor: Function that is called on every rank after each iteration.
        start: Initial state; None for the unloaded bodies.
        before: State of the level before ``start``, if there is one.

    Yields:
        The levels. If a level does not converge, it is the last; the level before it has the last
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
    """Solve levels of growing work from first yield, until the caller stops. Collective.

    If bodies are loaded or moved at ζ = 0, or have friction, the first level is ζ = 0, and α − α₀
    grows instead of α.

    α grows by a factor that decreases where ζ(α) bends or a level needs many steps, and increases
    on the plateau. Each level starts from the extrapolation of the previous two levels, or follows
    a mechanism. If a level fails, it is tried again with half the step.

    Args:
        solver: ALG3 or ALG4.
        monitor: Function that is called on every rank after each iteration.
        reached: Progress from which to continue; None to start at first yield.
        ahead: Function that may return a leap before each step except the first.

    Yields:
        The levels. If a level does not converge after ``MOST_HALVINGS`` halvings of its step, it is
        the last.
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
            reason = level.report.reason
            log.info("alpha = %.6g failed (%s); retrying with half the step", target, reason)
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
    """Return the level, with time and counts that include the first-yield state and failed steps.

    Args:
        level: The level.
        solver: Solver with the counts after the level.
        seconds: Wall time of the level, including failed steps.
        before: Counts before the first of these steps.
    """
    now = counts(solver.linear, solver.program)
    counted = {name: count - before[name] for name, count in now.items()}
    report = dataclasses.replace(level.report, seconds=seconds, **counted)
    return dataclasses.replace(level, report=report)


def _nearer(target: float, alpha: float, rest: float) -> float:
    """Return a target with half the step in α; for a leap, half the step in the logarithm of α."""
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
    """Return the start of a level, on the line through the previous two levels."""
    problem, prescribes = solver.problem, solver.prescribes
    if before is None and (problem.has_gaps or not problem.is_elastic_at_first()):
        return last
    # Largest distance of the start from the last level: relative to the distance between the last
    # two levels, and relative to the distance from the unloaded state. Where bodies yield, the line
    # soon leaves the path.
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

    The result has the active set and the history of the later state.

    Args:
        problem: Problem of the states.
        before: The earlier state; None for the unloaded state.
        last: The later state; without it, the function returns None.
        value: Prescribed ζ or α.
        prescribes: The prescribed quantity.
        longest: Largest distance from the later state, relative to the distance between the states.

    Returns:
        The state; ``last`` itself if the two states have the same load.
    """
    if last is None:
        return None
    earlier, here = prescribes.of(before) if before else 0.0, prescribes.of(last)
    no_line = 1e-12  # loads count as equal up to this relative difference
    if abs(here - earlier) <= no_line * max(abs(here), abs(earlier)):
        return last
    stretch = float(np.clip((value - here) / (here - earlier), -longest, longest))
    u = fem.Function(problem.V, name="displacement")
    first = before.u.x.array if before else 0.0
    u.x.array[:] = last.u.x.array + stretch * (last.u.x.array - first)
    alpha = last.alpha + stretch * (last.alpha - (before.alpha if before else 0.0))
    zeta = last.zeta + stretch * (last.zeta - (before.zeta if before else 0.0))
    return State(u, zeta, alpha, last.active, last.history)


GROWTH = 1.5
"""Ratio of each load factor to the previous load factor."""


def stroke(solver: LevelSolver, until: float) -> list[float]:
    """Return load factors from first yield to ``until``. Collective.

    First yield is only an estimate if there are gaps or constant loads.

    Args:
        solver: Solver of a problem in which ζ moves something; the function changes its iterate.
        until: The last load factor.

    Raises:
        LinearFailure: If the elastic problem cannot be solved.
    """
    iterate, program = solver.iterate, solver.program
    solver.problem.move_to(until)
    active = iterate.begin(None)
    program.set_operator(iterate.operator(1.0))
    found = program.solve(iterate.gradient(until), iterate.room(), active, rtol=1e-8)
    iterate.aim(found.delta)
    iterate.advance(1.0)
    overstress = iterate.fields.largest_overstress()
    values = [until]
    if overstress > 1:
        first = until / overstress
        while values[0] / first > GROWTH:
            values.insert(0, values[0] / GROWTH)
        values.insert(0, first)
    return values
