"""Compute stresses and tangents of laws by active planes and by bisection, with NumPy only.

All are projections of Ce on a convex set in the norm of C⁻¹, at many points at once.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import matrices, vectors

Array = npt.NDArray[np.float64]

DEV = np.eye(6) - np.outer([1, 1, 1, 0, 0, 0], [1, 1, 1, 0, 0, 0]) / 3
SETS = ([], [(0, 2)], [(0, 2), (1, 2)], [(0, 2), (0, 1)])
"""Planes (i, j), (1 + s)σ_i − (1 − s)σ_j = b, on which sorted principal stresses may lie."""


def hooke(bulk: float, shear: float) -> Array:
    """Return C, shape (6, 6)."""
    found: Array = 2 * shear * DEV + 3 * bulk * (np.eye(6) - DEV)
    return found


@dataclass(frozen=True)
class Projected:
    """The results of projections.

    Attributes:
        stress: Shape (n, 6).
        tangent: Shape (n, 6, 6).
        branch: Set of active planes, shape (n,).
    """

    stress: Array
    tangent: Array
    branch: npt.NDArray[np.int64]


def principal(e: Array, bulk: float, shear: float, sine: float, strength: float) -> Projected:
    """Project on (1 + s)σ₁ − (1 − s)σ₃ ≤ b, with the planes whose multipliers are positive."""
    lame = bulk - 2 * shear / 3
    C = lame + 2 * shear * np.eye(3)
    w, axes = np.linalg.eigh(matrices(e))
    w, axes = w[:, ::-1], axes[:, :, ::-1]
    trial = w @ C
    found, slopes, wrong = [], [], []
    for planes in SETS:
        N = np.zeros((len(planes), 3))
        for row, (i, j) in zip(N, planes, strict=True):
            row[i], row[j] = 1 + sine, sine - 1
        off = trial @ N.T - strength
        steep = np.linalg.inv(N @ C @ N.T) if planes else np.zeros((0, 0))
        multipliers = off @ steep
        stress = trial - multipliers @ N @ C
        above = (1 + sine) * stress.max(axis=1) - (1 - sine) * stress.min(axis=1) - strength
        least = multipliers.min(axis=1, initial=np.inf) * shear
        found.append(stress)
        slopes.append(C - C @ N.T @ steep @ N @ C)
        wrong.append(np.maximum(above, np.where(np.isinf(least), 0.0, -least)))
    if sine > 0:
        tip = np.full_like(trial, strength / (2 * sine))
        # in the cone of the normals: no admissible stress does more work on the plastic strain
        lost = np.linalg.solve(C, (trial - tip).T).T
        found.append(tip)
        slopes.append(np.zeros((3, 3)))
        wrong.append(shear * (sine * np.abs(lost).sum(axis=1) - lost.sum(axis=1)))
    branch = np.argmin(np.maximum(wrong, 1e-13 * np.abs(trial).max(axis=1)), axis=0)
    some = np.arange(len(e))
    values, A = np.array(found)[branch, some], np.array(slopes)[branch]
    stress = vectors(np.einsum("nai,ni,nbi->nab", axes, values, axes))
    own = [vectors(np.einsum("na,nb->nab", axes[:, :, i], axes[:, :, i])) for i in range(3)]
    tangent = sum(
        A[:, i, j, None, None] * own[i][:, :, None] * own[j][:, None]
        for i in range(3)
        for j in range(3)
    )
    for i, j in ((0, 1), (0, 2), (1, 2)):
        gap = w[:, i] - w[:, j]
        meet = gap <= 1e-9 * np.abs(w).max(axis=1)
        turns = (values[:, i] - values[:, j]) / np.where(meet, 1.0, gap)
        turns = np.where(meet, A[:, i, i] - A[:, i, j], turns)
        both = np.einsum("na,nb->nab", axes[:, :, i], axes[:, :, j])
        mixed = vectors(both + np.swapaxes(both, 1, 2)) / np.sqrt(2)
        tangent = tangent + turns[:, None, None] * mixed[:, :, None] * mixed[:, None]
    return Projected(stress, np.asarray(tangent), branch)


def quadratic(e: Array, C: Array, form: Array, strength: float) -> Projected:
    """Project on s:form:s ≤ Y²: σ = (C⁻¹ + x form)⁻¹e, with x by bisection and Newton."""
    L = np.linalg.cholesky(C)
    h, V = np.linalg.eigh(L.T @ form @ L)
    h, frame = np.maximum(h, 0.0), L @ V
    z = e @ frame

    def square(x: Array) -> Array:
        found: Array = (h * (z / (1 + x[:, None] * h)) ** 2).sum(axis=1)
        return found

    plastic = square(np.zeros(len(e))) > strength**2
    low, high = np.zeros(len(e)), np.ones(len(e)) / h.max()
    while (more := square(high) > strength**2).any():
        high[more] *= 4
    for _ in range(60):
        middle = (low + high) / 2
        above = square(middle) > strength**2
        low, high = np.where(above, middle, low), np.where(above, high, middle)
    x = np.where(plastic, (low + high) / 2, 0.0)
    left = 1 / (1 + x[:, None] * h)
    stress = (z * left) @ frame.T
    soft = np.einsum("ai,ni,bi->nab", frame, left, frame)
    q = np.einsum("nab,bc,nc->na", soft, form, stress)
    size = np.einsum("na,ab,nb->n", stress, form, q)
    share = np.where(plastic, 1 / np.where(plastic, size, 1.0), 0.0)
    tangent = soft - share[:, None, None] * q[:, :, None] * q[:, None]
    return Projected(stress, tangent, plastic.astype(np.int64))


def conical(e: Array, bulk: float, shear: float, eta: float, cohesion: float) -> Projected:
    """Project on ‖dev s‖/√2 + ηp ≤ c in the half-plane of p and ‖dev s‖, on a ray or its tip."""
    trace, d = e[:, :3].sum(axis=1), e @ DEV
    size = np.linalg.norm(d, axis=1)
    n = d / np.maximum(size, 1e-300)[:, None]
    # energies are r²/4μ + p²/2κ: in coordinates r/√(2μ), p/√κ the projection is the nearest point
    x, y = np.sqrt(2 * shear) * size, np.sqrt(bulk) * trace
    a, b = np.sqrt(shear), eta * np.sqrt(bulk)
    off = a * x + b * y - cohesion
    tip = cohesion / b if b > 0 else np.inf
    branch = np.where(off <= 0, 0, np.where(x - a * off / (a**2 + b**2) >= 0, 1, 2))
    step = np.where(branch == 1, off / (a**2 + b**2), 0.0)
    x1, y1 = np.where(branch == 2, 0.0, x - a * step), np.where(branch == 2, tip, y - b * step)
    unit = np.array([1.0, 1, 1, 0, 0, 0])
    stress = np.sqrt(2 * shear) * x1[:, None] * n + np.sqrt(bulk) * y1[:, None] * unit
    across = np.where(branch == 0, 2 * shear, np.sqrt(2 * shear) * x1 / np.maximum(size, 1e-300))
    keep = np.where(branch == 2, 0.0, 1.0)
    drop = np.where(branch == 1, 1 / (a**2 + b**2), 0.0)
    steep = np.sqrt(2 * shear) * a * n + np.sqrt(bulk) * b * unit
    nn = n[:, :, None] * n[:, None]
    tangent = across[:, None, None] * (DEV - nn) + keep[:, None, None] * (
        2 * shear * nn + bulk * np.outer(unit, unit)
    )
    tangent -= drop[:, None, None] * steep[:, :, None] * steep[:, None]
    return Projected(stress, tangent, branch)
