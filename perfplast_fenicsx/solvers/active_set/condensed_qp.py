"""Decide which of a few pairs are closed, for given other pairs: a dense quadratic program."""

from dataclasses import dataclass, replace

import numpy as np

from perfplast_fenicsx.arrays import Floats, PairFlags
from perfplast_fenicsx.solvers.active_set.equality_qp import (
    EqualityProgram,
    Held,
    QuadraticModel,
)

TOLERANCE = 1e-6
"""Relative tolerance of the linear solves for the condensation."""


@dataclass(frozen=True)
class Condensed:
    """Solution of a contact QP for only a few pairs.

    Attributes:
        closed: Which of these pairs remain closed, False elsewhere, shape (num_pairs,).
        solves: Number of systems solved for it.
    """

    closed: PairFlags
    solves: int


def condense(
    program: EqualityProgram, model: QuadraticModel, *, held: PairFlags, undecided: PairFlags
) -> Condensed:
    """Solve the contact QP for only the undecided pairs. Collective.

    With all of them held, each gets a unit jump in turn: one solve per pair, with one set-up.

    Args:
        program: Equality-constrained QPs of the operator.
        model: The function to be minimised, with ``jumps`` the room of each pair.
        held: Other pairs that are held closed, shape (num_pairs,).
        undecided: The few undecided pairs, shape (num_pairs,).

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
    """Return the pairs that remain closed, from :func:`openings`; shape (n,)."""
    closed: PairFlags = openings(stiffness, forces) <= 0
    return closed


def openings(stiffness: Floats, forces: Floats) -> Floats:
    """Return the scaled z ≥ 0 that minimises ½ zᵀSz − gᵀz; only its zeros matter.

    With S = R Rᵀ this is the least-squares problem min ‖Rᵀz − R⁻¹g‖ over z ≥ 0, which the method of
    Lawson and Hanson solves exactly (Solving Least Squares Problems, SIAM 1995, chapter 23).

    Args:
        stiffness: S, symmetric positive definite up to rounding: force on each pair for a unit
            opening of each, shape (n, n).
        forces: g, the energy gained per small opening of each pair, shape (n,).

    Returns:
        z times the roots of the diagonal of S, shape (n,).
    """
    from scipy.optimize import (
        nnls,
    )  # importing it takes a tenth of a second, and few programs need it

    S = (stiffness + stiffness.T) / 2
    largest = float(np.diag(S).max(initial=1e-300))
    scale = np.sqrt(np.maximum(np.diag(S), 1e-30 * largest))
    values, vectors = np.linalg.eigh(S / np.outer(scale, scale))
    # Smallest eigenvalue of the scaled matrix, so that rounding does not make it indefinite.
    regularisation = 1e-13
    roots = np.sqrt(np.maximum(values, regularisation))
    found, _ = nnls(roots[:, None] * vectors.T, (vectors.T @ (forces / scale)) / roots)
    scaled: Floats = found
    return scaled
