"""Detect gaps that close on a loading path, at which steps in α end.

If a body has reached a limit load of its own, ζ(α) is constant until a gap closes and another body
supports it. The line through the last two levels predicts the closing; beyond it there is another
curve.
"""

from mpi4py import MPI

import numpy as np

from perfplast_fenicsx.arrays import Floats, PairFlags
from perfplast_fenicsx.problem.judged.state import State
from perfplast_fenicsx.problem.problem import Problem


def closing_work(problem: Problem, before: State, last: State, alpha: float) -> float:
    """Return the work at which half of the pairs that close before α have closed, or α itself.

    Collective.

    The result is α if no more pairs close than are already closed: contact then grows gradually, as
    that of round bodies.

    Args:
        problem: Problem of the states.
        before: State of the level before ``last``.
        last: State of the last level.
        alpha: The work of the next level, larger than that of the last one.
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
    # Number of binary digits of the step to which the closing work is found.
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
    """Return the room g − s of the pairs on this rank, shape (num_pairs,), and which have none.

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
