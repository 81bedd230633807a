"""Yield sets that are one second-order cone, as numbers, and coordinates in which it is upright.

A set {x : ‖Mx‖ ≤ c − q·x} of n stress components x (Mandel) with a matrix M of rank n − 1 or n is

    x = F (p, s),    ‖s + γt‖ ≤ γ − αp,    α ≥ 0,  ‖t‖ < 1,  and t = 0 where α > 0,

with ε' = Fᵀε as strain rates, so that σ:ε = p ε'₀ + s·ε'₁. If M has a null vector ν, p is along it:
α > 0 where q·ν ≠ 0, and where it is zero nothing bounds p. A matrix of rank n bounds all stresses,
and there is no p: F has a column of zeros for it. Where q = Mᵀr, ‖r‖ < 1, the set is an ellipsoid
(or a cylinder over one) about another stress than zero, which t gives.

In plane strain the stress out of the plane is in no equation. The set is then the shadow of the
whole one on the others: with a = Me and b = q·e for the free component e, and β = b/‖a‖,

    min_τ ‖M(x + τe)‖ − c + q·(x + τe) = √(1 − β²)‖Py‖ − c + q·x − β a·y/‖a‖,    y = Mx,

where P takes a off; |β| ≥ 1 leaves room for any x.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from perfplast_fenicsx.arrays import Floats

ROUNDING = 1e-12
"""Difference of entries of matrices of about 1, or share of the largest singular value, that counts
as none."""


@dataclass(frozen=True, eq=False)
class PlainCone:
    """‖matrix·x‖ ≤ bound − slope·x, numbers.

    Attributes:
        bound: c ≥ 0 (stress), 0 of what the slope closes.
        slope: q, shape (n,).
        matrix: M of full row rank, shape (k, n).
    """

    bound: float
    slope: Floats
    matrix: Floats

    @property
    def is_cone(self) -> bool:
        """Whether shapes, signs and the rank of the matrix are those of a cone with 0 in it."""
        numbers = (np.array([self.bound]), self.slope, self.matrix)
        if self.matrix.ndim != 2 or self.slope.shape != self.matrix.shape[1:]:
            return False
        if not (all(np.isfinite(it).all() for it in numbers) and self.bound >= 0):
            return False
        values = np.linalg.svd(self.matrix, compute_uv=False)
        k, n = self.matrix.shape
        if self.bound == 0 and not (k == n - 1 and self.slope.any()):
            return False
        return 0 < k <= n and bool(values[-1] > ROUNDING * values[0])

    def normalised(self) -> "PlainCone":
        """Return the same set, the geometric mean of the matrix' singular values being 1."""
        values = np.linalg.svd(self.matrix, compute_uv=False)
        size = float(np.exp(np.log(values).mean()))
        slope, matrix = (np.asarray(it / size, np.float64) for it in (self.slope, self.matrix))
        return PlainCone(self.bound / size, slope, matrix)

    def is_same(self, other: "PlainCone") -> bool:
        """Return whether the numbers are the same to the last digit."""
        alike = np.array_equal(self.slope, other.slope)
        return alike and self.bound == other.bound and np.array_equal(self.matrix, other.matrix)


@dataclass(frozen=True, eq=False)
class Shadow:
    """The projection of a cone along a free component of the stress.

    Attributes:
        cone: Cone of the others; None where these are not bounded.
        along: The free one is along·x − share·‖matrix·x‖ where that leaves the most room, with the
            matrix of ``cone``; shape (n − 1,).
        share: As ``along``.
    """

    cone: PlainCone | None
    along: Floats
    share: float


def shadow(cone: PlainCone, at: int, usual: Floats) -> Shadow:
    """Return the set of what the other components can be.

    Args:
        cone: Cone of all components.
        at: Number of the free one.
        usual: What the free one is of the others where the cone says nothing, shape (n − 1,).
    """
    a, b = cone.matrix[:, at], float(cone.slope[at])
    rest, q = np.delete(cone.matrix, at, axis=1), np.delete(cone.slope, at)
    size = float(np.linalg.norm(a))
    if size <= ROUNDING * np.linalg.norm(cone.matrix):
        free = b != 0
        return Shadow(None if free else PlainCone(cone.bound, q, rest), usual, 0.0)
    unit, beta = a / size, b / size
    if abs(beta) >= 1:
        return Shadow(None, usual, 0.0)
    root = math.sqrt(1 - beta**2)
    others = np.linalg.svd(unit[None])[2][1:]
    matrix: Floats = np.asarray(others @ rest, np.float64)
    slope: Floats = np.asarray((q - beta * unit @ rest) / root, np.float64)
    along: Floats = np.asarray(-(unit @ rest) / size, np.float64)
    return Shadow(PlainCone(cone.bound / root, slope, matrix), along, beta / (size * root))


@dataclass(frozen=True, eq=False)
class StandardCone:
    """x = F (p, s) with ‖s + γt‖ ≤ γ − αp.

    Attributes:
        radius: γ (stress); ∞ of what never yields, 0 without cohesion.
        slope: α ≥ 0.
        tilt: t, shape (k,).
        frame: F, shape (n, 1 + k).
        isotropic: Whether p is the mean of normal stresses and s the deviator of the rest, in an
            orthonormal basis of these.
    """

    radius: float
    slope: float
    tilt: Floats
    frame: Floats
    isotropic: bool


def never_yields(n: int, normal: int) -> StandardCone:
    """Return all stresses, in mean stress and deviator.

    Args:
        n: Components.
        normal: How many of them, the first, are normal stresses.
    """
    unit = np.zeros(n)
    unit[:normal] = 1.0
    frame = np.column_stack([unit, np.linalg.svd(unit[None])[2][1:].T])
    return StandardCone(math.inf, 0.0, np.zeros(n - 1), frame, True)


@dataclass(frozen=True)
class PlainPrincipal:
    """(1 + sine)σ₁ − (1 − sine)σ₃ ≤ bound and σ₁ ≤ tension, numbers.

    Attributes:
        bound: b ≥ 0 (stress), 0 where there is a sine alone.
        sine: s in [0, 1).
        tension: f > 0 (stress), ∞ where nothing else bounds σ₁.
    """

    bound: float
    sine: float
    tension: float = math.inf

    def in_plane(self) -> PlainCone:
        """Return the cone of the stresses in the plane, with the one out of it free.

        It is between the principal ones in the plane where it leaves them the most room.
        """
        half = 1 / math.sqrt(2)
        matrix = np.array([[half, -half, 0.0], [0.0, 0.0, 1.0]])
        slope = np.array([half * self.sine, half * self.sine, 0.0])
        return PlainCone(half * self.bound, slope, matrix)

    def around(self, n: int, normal: int) -> StandardCone:
        """Return a cone about the hydrostatic axis that has the set inside.

        It is the narrowest one of the same apex, where friction makes one; a tensile strength
        without friction has one of slope 1.

        Args:
            n: Components.
            normal: How many of them are normal stresses.
        """
        size = math.sqrt(6) / (3 - self.sine)
        radius, slope = size * self.bound, 2 * size * self.sine
        if not slope and math.isfinite(self.tension):
            radius, slope = radius + self.tension, 1.0
        return replace(never_yields(n, normal), radius=radius, slope=slope, isotropic=False)


def standard_cone(cone: PlainCone, normal: int) -> StandardCone | None:
    """Return the coordinates of a cone, and its numbers in these; None of sets that have none.

    These are sets with more than one direction that nothing bounds, and hyperboloids.

    Args:
        cone: Normalised (:meth:`PlainCone.normalised`).
        normal: How many components, the first, are normal stresses.
    """
    M, q = cone.matrix, cone.slope
    k, n = M.shape
    if k < n - 1:
        return None
    null, pull = np.zeros(n), 0.0
    if k == n - 1:
        null = np.linalg.svd(M)[2][-1]
        null = null if null[:normal].sum() >= 0 else -null
        pull = float(q @ null)
        pull = 0.0 if abs(pull) <= ROUNDING * np.linalg.norm(q) else pull
    column = math.sqrt(normal) * null
    if pull:
        column = math.copysign(1.0, pull) * column
        alpha = math.sqrt(normal) * abs(pull)
        frame = np.linalg.inv(np.vstack([q / alpha, M]))
        frame[:, 0] = column
        even = bool(np.abs(q - pull * null).max() <= ROUNDING * alpha)
        same = _is_isotropic(M, normal) and even and pull > 0
        return StandardCone(cone.bound, alpha, np.zeros(k), frame, same)
    back = np.linalg.inv(M @ M.T) @ M
    tilt = back @ q if k == n or q.any() else np.zeros(k)
    size = float(np.linalg.norm(tilt))
    if size >= 1:
        return None
    root = math.sqrt((1 - size) * (1 + size))
    longer = np.eye(k) + (1 / root - 1) / max(size**2, ROUNDING**2) * np.outer(tilt, tilt)
    frame = np.column_stack([column, back.T @ longer])
    same = k == n - 1 and not size and _is_isotropic(M, normal)
    return StandardCone(cone.bound / root, 0.0, tilt, frame, same)


def _is_isotropic(M: Floats, normal: int) -> bool:
    """Return whether ‖Mx‖ is the size of the deviator of normal stresses, and shears."""
    k, n = M.shape
    unit = np.zeros(n)
    unit[:normal] = 1 / math.sqrt(normal)
    off = M.T @ M - np.eye(n) + np.outer(unit, unit)
    return k == n - 1 and bool((np.abs(off) <= ROUNDING).all())
