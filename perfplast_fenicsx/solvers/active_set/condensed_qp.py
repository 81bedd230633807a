"""Which of a few pairs are closed, everything else given: a dense quadratic program with bounds."""

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import numpy.typing as npt
from scipy.optimize import nnls

from perfplast_fenicsx.solvers.active_set.equality_qp import EqualityProgram, Flags

TOLERANCE = 1e-6
"""Relative tolerance of the linear solves that condense."""

REGULARISATION = 1e-13
"""Smallest eigenvalue of the scaled matrix, lest rounding make it indefinite."""


def condense(
    comm: MPI.Intracomm,
    system: EqualityProgram,
    index: npt.NDArray[np.int32],
    closed: Flags,
    chosen: Flags,
    room: npt.NDArray[np.float64],
    r: PETSc.Vec,
    work: float | None,
) -> Flags:
    """Solve the contact quadratic program for the chosen pairs alone. Collective.

    With all of them held, each gets a unit jump in turn: one solve a pair, with one set-up.

    Args:
        comm: The ranks.
        system: Linear systems with held pairs.
        index: Local index of each pair's jump, shape (num_pairs,), as all that follows.
        closed: Other pairs that are closed.
        chosen: The few pairs to decide on.
        room: How far each pair may still close.
        r: Gradient at δ = 0.
        work: ℓᵀδ if it is prescribed.

    Returns:
        Which of the chosen pairs stay closed; False elsewhere.
    """
    local = np.flatnonzero(chosen)
    last = comm.scan(len(local))
    count, mine = comm.allreduce(len(local)), slice(last - len(local), last)
    delta, gradient, nothing = r.duplicate(), r.duplicate(), r.duplicate()
    columns = np.zeros((count, count + 1))
    for number in range(count + 1):
        if number < count:
            values = np.zeros_like(room)
            if mine.start <= number < mine.stop:
                values[local[number - mine.start]] = 1.0
            load, prescribed = nothing, None if work is None else 0.0
        else:
            values, load, prescribed = room, r, work
        multiplier = system.minimise(closed | chosen, values, load, prescribed, TOLERANCE, delta)
        system.gradient(delta, load, multiplier, gradient)
        columns[mine, number] = gradient.array_r[index[local]]
    for vector in (delta, gradient, nothing):
        vector.destroy()
    columns = comm.allreduce(columns)
    stay: Flags = np.zeros_like(chosen)
    stay[local] = closed_pairs(columns[:, :count], columns[:, count])[mine]
    return stay


def closed_pairs(stiffness: npt.NDArray[np.float64], forces: npt.NDArray[np.float64]) -> Flags:
    """Pairs that stay closed where z ≥ 0 minimises ½ zᵀSz − gᵀz.

    With S = R Rᵀ this is the least-squares problem min ‖Rᵀz − R⁻¹g‖ over z ≥ 0, which the method of
    Lawson and Hanson solves exactly (Solving Least Squares Problems, SIAM 1995, chapter 23).

    Args:
        stiffness: S, symmetric positive definite up to rounding: force on each pair for a unit
            opening of each, shape (n, n).
        forces: g, energy gained by opening each pair a little, shape (n,).

    Returns:
        Where z = 0, shape (n,).
    """
    S = (stiffness + stiffness.T) / 2
    largest = float(np.diag(S).max(initial=1e-300))
    scale = np.sqrt(np.maximum(np.diag(S), 1e-30 * largest))
    values, vectors = np.linalg.eigh(S / np.outer(scale, scale))
    roots = np.sqrt(np.maximum(values, REGULARISATION))
    openings, _ = nnls(roots[:, None] * vectors.T, (vectors.T @ (forces / scale)) / roots)
    closed: Flags = openings <= 0
    return closed
