"""Which of a few pairs are closed: a dense quadratic program with bounds."""

import numpy as np
import numpy.typing as npt
from scipy.optimize import nnls

REGULARISATION = 1e-13
"""Added to the diagonal, relative to its mean, lest rounding make the matrix indefinite."""


def closed_pairs(
    stiffness: npt.NDArray[np.float64], forces: npt.NDArray[np.float64]
) -> npt.NDArray[np.bool_]:
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
    S[np.diag_indices_from(S)] += REGULARISATION * np.trace(S) / len(S)
    scale = np.sqrt(np.diag(S))
    values, vectors = np.linalg.eigh(S / np.outer(scale, scale))
    roots = np.sqrt(np.maximum(values, REGULARISATION))
    openings, _ = nnls(roots[:, None] * vectors.T, (vectors.T @ (forces / scale)) / roots)
    closed: npt.NDArray[np.bool_] = openings <= 0
    return closed
