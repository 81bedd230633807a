"""Gaps that close on a loading path: events at which steps in α end.

Where a body has reached a limit load of its own, ζ(α) is level until a gap closes and another body
helps it. The line through the last two levels shows when; what lies beyond is another curve.
"""

from mpi4py import MPI

import numpy as np

from perfplast_fenicsx.arrays import Floats, PairFlags
from perfplast_fenicsx.problem.judged.state import State
from perfplast_fenicsx.problem.problem import Problem


def closing_work(problem: Problem, before: State, last: State, alpha: float) -> float:
    """Return where half of the pairs that close before α have done so, or α itself. Collective.

    It is α where no more close than are closed already: contact then grows from what there is, as
    that of round bodies, and is no event.

    Args:
        problem: Whose states they are.
        before: State of the level before the last one.
        last: State of the last level.
        alpha: The work of the next level, beyond that of the last one.
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
    # The α at which half of the pairs have closed is found to this many binary digits of the step.
    bisections = 20
    for _ in range(bisections):
        middle = (low + high) / 2
        half = 2 * problem.comm.allreduce(int((when <= middle).sum())) >= counts[0]
        low, high = (low, middle) if half else (middle, high)
    return last.alpha + high


def has_closed(problem: Problem, before: State, last: State) -> bool:
    """Whether more pairs have closed in the last level than were closed before. Collective."""
    if not problem.has_gaps:
        return False
    then, now = (np.count_nonzero(_room(problem, state)[1]) for state in (before, last))
    counts = problem.comm.allreduce(np.array([then, now]), MPI.SUM)
    return bool(counts[1] > 2 * counts[0])


def _room(problem: Problem, state: State) -> tuple[Floats, PairFlags]:
    """Room g − s of the pairs hosted here, shape (num_pairs,), and where there is none.

    Collective.
    """
    basis, jumps = problem.basis, problem.create_vector()
    basis.M.mult(state.u.x.petsc_vec, jumps)
    room = basis.gap - jumps.array_r[basis.index]
    jumps.destroy()
    size = np.abs(state.u.x.array).max(initial=0)
    largest = float(problem.comm.allreduce(size, MPI.MAX))
    closed = 1e-9  # room below this share of the largest displacement is zero
    return room, room <= closed * largest
