"""Represent yield sets that are second-order cones, and transform them to standard coordinates.

For n Mandel components x of stress and a matrix M of rank n − 1 or n, the set ‖Mx‖ ≤ c − q·x is

    x = F (p, s),    ‖s + γt‖ ≤ γ − αp,    α ≥ 0,  ‖t‖ < 1,  and t = 0 where α > 0,

with the strain rates ε' = Fᵀε and σ:ε = p ε'₀ + s·ε'₁. If M has a null vector ν, p is the component
along ν. In this case α > 0 if q·ν ≠ 0; otherwise p is unbounded. If M has rank n, all stresses are
bounded and the set has no p; the column of F for p is then zero. If q = Mᵀr with ‖r‖ < 1, the set
is an ellipsoid (or a cylinder over an ellipsoid) whose centre is not at zero stress. The tilt t
describes the shift of the centre.

In plane strain, no equation contains the out-of-plane stress, and the set is projected onto the
other components. Let e be the unit vector of the free (out-of-plane) component, a = Me, b = q·e and
β = b/‖a‖. Then

    min_τ ‖M(x + τe)‖ − c + q·(x + τe) = √(1 − β²)‖Py‖ − c + q·x − β a·y/‖a‖,    y = Mx,

where P projects onto the complement of a. If |β| ≥ 1, the projection contains all x.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from perfplast_fenicsx.arrays import Floats

ROUNDING = 1e-12
"""Largest difference between matrix entries of about 1, or largest fraction of the greatest
singular value, that counts as zero.
"""


@dataclass(frozen=True, eq=False)
class PlainCone:
    """The cone ‖matrix·x‖ ≤ bound − slope·x, as numbers.

    Attributes:
        bound: Bound c ≥ 0 (stress); 0 without cohesion, and the slope must then not be zero.
        slope: Vector q, shape (n,).
        matrix: Matrix M of full row rank, shape (k, n).
    """

    bound: float
    slope: Floats
    matrix: Floats

    @property
    def is_cone(self) -> bool:
        """Return whether shapes, signs and rank describe a cone that contains zero stress."""
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
        """Return the same set, with a matrix whose singular values have the geometric mean 1."""
        values = np.linalg.svd(self.matrix, compute_uv=False)
        size = float(np.exp(np.log(values).mean()))
        slope, matrix = (np.asarray(it / size, np.float64) for it in (self.slope, self.matrix))
        return PlainCone(self.bound / size, slope, matrix)

    def __eq__(self, other: object) -> bool:
        """Return whether all numbers of both cones are exactly equal."""
        if not isinstance(other, PlainCone):
            return NotImplemented
        return all(map(np.array_equal, vars(self).values(), vars(other).values()))


@dataclass(frozen=True, eq=False)
class Shadow:
    """The projection of a cone along a free component of the stress.

    Attributes:
        cone: Cone of the other components; None if these components are unbounded.
        along: Vector in the formula along·x − share·‖Mx‖ for the free component that is deepest in
            the set, shape (n − 1,). M is the matrix of ``cone``, and x are the other components.
        share: Coefficient ``share`` in the same formula.
    """

    cone: PlainCone | None
    along: Floats
    share: float


def shadow(cone: PlainCone, at: int, usual: Floats) -> Shadow:
    """Return the projection of a cone onto all components except a free component.

    Args:
        cone: Cone of all components.
        at: Index of the free component.
        usual: Value for ``along`` if the cone does not determine the free component, shape (n −
            1,).
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
    """The cone x = F (p, s) with ‖s + γt‖ ≤ γ − αp.

    Attributes:
        radius: Yield radius γ (stress); ∞ if nothing yields, 0 without cohesion.
        slope: Slope α ≥ 0.
        tilt: Tilt t, shape (k,).
        frame: Frame F, shape (n, 1 + k).
        isotropic: Whether p is the mean of the normal stresses, and s the deviator in an
            orthonormal basis.
    """

    radius: float
    slope: float
    tilt: Floats
    frame: Floats
    isotropic: bool


def never_yields(n: int, normal: int) -> StandardCone:
    """Return the set of all stresses, with the mean stress and the deviator as coordinates.

    Args:
        n: Number of components.
        normal: Number of normal stresses, which are the first components.
    """
    unit = np.zeros(n)
    unit[:normal] = 1.0
    frame = np.column_stack([unit, np.linalg.svd(unit[None])[2][1:].T])
    return StandardCone(math.inf, 0.0, np.zeros(n - 1), frame, True)


@dataclass(frozen=True)
class PlainPrincipal:
    """The set (1 + sine)σ₁ − (1 − sine)σ₃ ≤ bound and σ₁ ≤ tension, as numbers.

    Attributes:
        bound: Bound b ≥ 0 (stress); if it is 0, the sine must be positive.
        sine: Sine s in [0, 1).
        tension: Tensile strength f > 0 (stress), ∞ without a tensile strength.
    """

    bound: float
    sine: float
    tension: float = math.inf

    def in_plane(self) -> PlainCone:
        """Return the cone of the in-plane stresses, with the out-of-plane stress free.

        An out-of-plane stress between the in-plane principal stresses is deepest in the set, and
        does not affect the bound.
        """
        half = 1 / math.sqrt(2)
        matrix = np.array([[half, -half, 0.0], [0.0, 0.0, 1.0]])
        slope = np.array([half * self.sine, half * self.sine, 0.0])
        return PlainCone(half * self.bound, slope, matrix)

    def around(self, n: int, normal: int) -> StandardCone:
        """Return a cone about the hydrostatic axis that encloses the set.

        With friction, the result is the narrowest cone with the same apex. With a tensile strength
        and no friction, the slope of the cone is 1.

        Args:
            n: Number of components.
            normal: Number of normal stresses.
        """
        size = math.sqrt(6) / (3 - self.sine)
        radius, slope = size * self.bound, 2 * size * self.sine
        if not slope and math.isfinite(self.tension):
            radius, slope = radius + self.tension, 1.0
        return replace(never_yields(n, normal), radius=radius, slope=slope, isotropic=False)


def standard_cone(cone: PlainCone, normal: int) -> StandardCone | None:
    """Return a cone in standard coordinates; None for sets without standard coordinates.

    Such sets are hyperboloids, or are unbounded in several directions.

    Args:
        cone: Normalised cone (:meth:`PlainCone.normalised`).
        normal: Number of normal stresses, which are the first components.
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
    """Return whether ‖Mx‖ is the norm of the stress deviator."""
    k, n = M.shape
    unit = np.zeros(n)
    unit[:normal] = 1 / math.sqrt(normal)
    off = M.T @ M - np.eye(n) + np.outer(unit, unit)
    return k == n - 1 and bool((np.abs(off) <= ROUNDING).all())
