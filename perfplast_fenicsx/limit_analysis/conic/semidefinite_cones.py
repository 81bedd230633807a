"""Symmetric matrices of 3 × 3 that are positive semidefinite, many at once, and their scaling.

Members are arrays of shape (..., 3, 3). Notation and formulas are those of M. J. Todd, K. C. Toh,
R. H. Tütüncü, On the Nesterov–Todd direction in semidefinite programming, SIAM J. Optim. 8 (1998),
769. What is done to each of them is written out, as libraries take longer to call. NumPy only.
"""

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.rounding import TINY

SIZE = 3
"""Rows of a matrix, and what each counts in the degree of a program."""


def product(a: Floats, b: Floats) -> Floats:
    """Jordan's product (ab + ba)/2."""
    one = a @ b
    return np.asarray((one + np.swapaxes(one, -1, -2)) / 2, dtype=np.float64)


def least_eigenvalue(a: Floats) -> Floats:
    """Return the least eigenvalue of each matrix, to rounding of its size, shape (...)."""
    mean = np.trace(a, axis1=-2, axis2=-1) / SIZE
    rest = a - mean[..., None, None] * np.eye(SIZE)
    size = np.sqrt(np.einsum("...ij,...ij->...", rest, rest) / 6)
    unit = rest / np.maximum(size, TINY)[..., None, None]
    cosine = np.clip(_determinant(unit) / 2, -1.0, 1.0)
    angle = (np.arccos(cosine) + 2 * np.pi) / 3
    found: Floats = mean + 2 * size * np.cos(angle)
    return found


def eigenvalues(a: Floats) -> Floats:
    """Return the eigenvalues of each matrix, the least first, shape (..., 3)."""
    return np.asarray(np.linalg.eigvalsh(a), dtype=np.float64)


def longest_step(a: Floats, da: Floats) -> float:
    """Largest t for which a + t da are semidefinite, a being so; ∞ if any is."""
    if not a.size:
        return np.inf
    back = _lower_inverse(_factor(a))
    least = float(least_eigenvalue(back @ da @ np.swapaxes(back, -1, -2)).min())
    return -1 / least if least < 0 else np.inf


class MatrixScaling:
    """The G of Nesterov and Todd with G⁻¹ s G⁻ᵀ = Gᵀ z G = Λ, for s and z inside.

    Attributes:
        point: Λ's diagonal, shape (..., 3).
    """

    def __init__(self, s: Floats, z: Floats) -> None:
        left = _factor(s)
        turned, self.point = _orthogonal_columns(np.swapaxes(_factor(z), -1, -2) @ left)
        root = np.sqrt(self.point)
        self._G = (left @ turned) / root[..., None, :]
        self._inverse = root[..., :, None] * (np.swapaxes(turned, -1, -2) @ _lower_inverse(left))

    def primal(self, s: Floats) -> Floats:
        """G⁻¹ s G⁻ᵀ."""
        return _congruent(self._inverse, s)

    def dual(self, z: Floats) -> Floats:
        """Gᵀ z G."""
        return _congruent(np.swapaxes(self._G, -1, -2), z)

    def undone(self, scaled: Floats) -> Floats:
        """Return the z whose :meth:`dual` is given."""
        return _congruent(np.swapaxes(self._inverse, -1, -2), scaled)

    def quotient(self, a: Floats) -> Floats:
        """Return the x whose Jordan product with Λ is a."""
        sums = self.point[..., :, None] + self.point[..., None, :]
        return np.asarray(2 * a / sums, dtype=np.float64)


def _congruent(G: Floats, a: Floats) -> Floats:
    found = G @ a @ np.swapaxes(G, -1, -2)
    return np.asarray((found + np.swapaxes(found, -1, -2)) / 2, dtype=np.float64)


def _determinant(a: Floats) -> Floats:
    first = a[..., 0, 0] * (a[..., 1, 1] * a[..., 2, 2] - a[..., 1, 2] ** 2)
    second = a[..., 0, 1] * (a[..., 0, 1] * a[..., 2, 2] - a[..., 1, 2] * a[..., 0, 2])
    third = a[..., 0, 2] * (a[..., 0, 1] * a[..., 1, 2] - a[..., 1, 1] * a[..., 0, 2])
    found: Floats = first - second + third
    return found


def _factor(a: Floats) -> Floats:
    """Cholesky's lower triangle; what rounding leaves below zero on its diagonal is as if small."""
    L: Floats = np.zeros_like(a)
    for i in range(SIZE):
        rest = a[..., i:, i] - np.einsum("...ij,...j->...i", L[..., i:, :i], L[..., i, :i])
        L[..., i:, i] = rest / np.sqrt(np.maximum(rest[..., :1], TINY))
        L[..., i, i] = np.sqrt(np.maximum(rest[..., 0], TINY))
    return L


def _lower_inverse(L: Floats) -> Floats:
    found: Floats = np.zeros_like(L)
    diagonal = 1 / np.stack([L[..., i, i] for i in range(SIZE)])
    for i in range(SIZE):
        found[..., i, i] = diagonal[i]
    found[..., 1, 0] = -L[..., 1, 0] * diagonal[0] * diagonal[1]
    found[..., 2, 1] = -L[..., 2, 1] * diagonal[1] * diagonal[2]
    below = L[..., 2, 0] * found[..., 0, 0] + L[..., 2, 1] * found[..., 1, 0]
    found[..., 2, 0] = -below * diagonal[2]
    return found


def _orthogonal_columns(a: Floats) -> tuple[Floats, Floats]:
    """V with columns of aV at right angles to each other, and their sizes: the singular values.

    One-sided rotations of Jacobi, which find small ones as well as large ones (J. Demmel,
    K. Veselić, SIAM J. Matrix Anal. Appl. 13 (1992), 1204).
    """
    columns = [a[..., i].copy() for i in range(SIZE)]
    turned = [np.broadcast_to(row, columns[0].shape).copy() for row in np.eye(SIZE)]
    # Rounds of Jacobi's rotations at most: four to six are usual, each squares what is left.
    sweeps = 12
    orthogonal = 1e-14  # cosine of the angle of two columns that counts as a right one
    for _ in range(sweeps):
        largest = 0.0
        for i, j in ((0, 1), (0, 2), (1, 2)):
            one, other = columns[i], columns[j]
            p, q = np.einsum("...k,...k->...", one, one), np.einsum("...k,...k->...", other, other)
            cross = np.einsum("...k,...k->...", one, other)
            size = np.maximum(np.sqrt(p) * np.sqrt(q), TINY)
            largest = max(largest, float((np.abs(cross) / size).max(initial=0.0)))
            safe = np.where(cross == 0, 1.0, cross)
            ratio = (q - p) / (2 * safe)
            t = np.copysign(1.0, ratio) / (np.abs(ratio) + np.hypot(1.0, ratio))
            t = np.where(cross == 0, 0.0, t)
            c = 1 / np.sqrt(1 + t**2)
            s = (c * t)[..., None]
            c = c[..., None]
            columns[i], columns[j] = c * one - s * other, s * one + c * other
            turned[i], turned[j] = c * turned[i] - s * turned[j], s * turned[i] + c * turned[j]
        if largest <= orthogonal:
            break
    sizes = np.stack([np.linalg.norm(column, axis=-1) for column in columns], axis=-1)
    return np.stack(turned, axis=-1), np.maximum(sizes, TINY)
