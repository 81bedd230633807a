"""Which of a few pairs are closed, everything else given: a dense quadratic program with bounds."""

from dataclasses import dataclass, replace

import numpy as np

from perfplast_fenicsx.arrays import Floats, PairFlags
from perfplast_fenicsx.solvers.active_set.equality_qp import (
    EqualityProgram,
    Held,
    QuadraticModel,
)

TOLERANCE = 1e-6
"""Relative tolerance of the linear solves that condense."""


@dataclass(frozen=True)
class Condensed:
    """Solution of a contact QP for a few pairs alone.

    Attributes:
        closed: Which of them stay closed, False elsewhere, shape (num_pairs,).
        solves: Systems solved for it.
    """

    closed: PairFlags
    solves: int


def condense(
    program: EqualityProgram, model: QuadraticModel, *, held: PairFlags, undecided: PairFlags
) -> Condensed:
    """Solve the contact QP for the undecided pairs alone. Collective.

    With all of them held, each gets a unit jump in turn: one solve a pair, with one set-up.

    Args:
        program: Equality-constrained QPs of the operator.
        model: What is minimised, with ``jumps`` the room of each pair.
        held: Other pairs that are held closed, shape (num_pairs,).
        undecided: The few pairs to decide on, shape (num_pairs,).

    Raises:
        LinearFailure: If a linear system cannot be solved.
    """
    local = np.flatnonzero(undecided)
    last = program.comm.scan(len(local))
    count, mine = program.comm.allreduce(len(local)), slice(last - len(local), last)
    delta, gradient, nothing = (model.r.duplicate() for _ in range(3))
    given = model.given.index
    unit = QuadraticModel(
        nothing,
        np.zeros_like(model.jumps),
        None if model.work is None else 0.0,
        TOLERANCE,
        Held(given, np.zeros(len(given))),
    )
    columns = np.zeros((count, count + 1))
    try:
        for number in range(count + 1):
            if number < count:
                jumps = np.zeros_like(model.jumps)
                if mine.start <= number < mine.stop:
                    jumps[local[number - mine.start]] = 1.0
                column = replace(unit, jumps=jumps)
            else:
                column = replace(model, rtol=TOLERANCE)
            solution = program.minimise(column, held | undecided, delta)
            program.gradient(solution, gradient)
            columns[mine, number] = gradient.array_r[program.index[local]]
    finally:
        for vector in (delta, gradient, nothing):
            vector.destroy()
    columns = program.comm.allreduce(columns)
    closed: PairFlags = np.zeros_like(undecided)
    closed[local] = closed_pairs(columns[:, :count], columns[:, count])[mine]
    return Condensed(closed, solves=count + 1)


def closed_pairs(stiffness: Floats, forces: Floats) -> PairFlags:
    """Return pairs that stay closed, of :func:`openings`; shape (n,)."""
    closed: PairFlags = openings(stiffness, forces) <= 0
    return closed


def openings(stiffness: Floats, forces: Floats) -> Floats:
    """Return the z ≥ 0 that minimises ½ zᵀSz − gᵀz, scaled: what counts is where it is zero.

    With S = R Rᵀ this is the least-squares problem min ‖Rᵀz − R⁻¹g‖ over z ≥ 0, which the method of
    Lawson and Hanson solves exactly (Solving Least Squares Problems, SIAM 1995, chapter 23).

    Args:
        stiffness: S, symmetric positive definite up to rounding: force on each pair for a unit
            opening of each, shape (n, n).
        forces: g, energy gained by opening each pair a little, shape (n,).

    Returns:
        z times the roots of the diagonal of S, shape (n,).
    """
    from scipy.optimize import nnls  # a tenth of a second, which few programs ask for

    S = (stiffness + stiffness.T) / 2
    largest = float(np.diag(S).max(initial=1e-300))
    scale = np.sqrt(np.maximum(np.diag(S), 1e-30 * largest))
    values, vectors = np.linalg.eigh(S / np.outer(scale, scale))
    # Smallest eigenvalue of the scaled matrix, lest rounding make it indefinite.
    regularisation = 1e-13
    roots = np.sqrt(np.maximum(values, regularisation))
    found, _ = nnls(roots[:, None] * vectors.T, (vectors.T @ (forces / scale)) / roots)
    scaled: Floats = found
    return scaled
