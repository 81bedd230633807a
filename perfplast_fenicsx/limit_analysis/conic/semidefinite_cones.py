"""Implement cones of semidefinite 3 × 3 matrices, and blocks of points with such cones, in NumPy.

Members are arrays of shape (..., 3, 3). Notation and formulas follow M. J. Todd, K. C. Toh, R. H.
Tütüncü, On the Nesterov–Todd direction in semidefinite programming, SIAM J. Optim. 8 (1998), 769.
The module writes out operations on 3 × 3 matrices, because library calls are slower.

The yield set of a point bounds principal stresses, (1 + s)σ₁ − (1 − s)σ₃ ≤ b: Mohr–Coulomb, or
Tresca if s = 0. A law may add a tensile strength, σ₁ ≤ f. With the mean stress p and the deviator
d, the yield set is the projection of a set in (p, d, t) that two matrices bound,

    t I − (1 + s) d ⪰ 0,    (1 − s) d + (b − t − 2sp) I ⪰ 0,

because the first matrix requires t ≥ (1 + s)d₁, and the second t ≤ b − 2sp + (1 − s)d₃ (K.
Krabbenhøft, A. V. Lyamin, S. W. Sloan, Int. J. Solids Struct. 45 (2008), 6552). Strain rates are
admissible if tr ε ≥ s Σ|ε_i|, and dissipate (b/2s) tr ε. If s = 0, they are admissible if tr ε = 0,
and dissipate (b/2) Σ|ε_i|.

If f < b/2s, a third matrix f I − pI − d ⪰ 0 bounds the set. The set then has three vertices with σ₁
= f, at which σ₂ and σ₃ are each either f or r = ((1 + s)f − b)/(1 − s). If s > 0, the tensile
strength changes neither the recession cone nor the admissible rates. If s = 0, the recession cone
contains hydrostatic compression only, and rates are admissible if tr ε ≥ 0. Admissible rates
dissipate (f − h) tr ε + h Σ|ε_i|, where h = (f − r)/2.

The members X_k = a_k t I + d_k dev σ + e_k p I + c_k b I are linear in y = (t, p, s)
(:class:`cone.SystemPoints`). If no member contains p (no friction, no tensile strength), the
proximal point method changes p.
"""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats, Longs, matrices, vectors
from perfplast_fenicsx.limit_analysis.conic.cone import (
    MOST_VISCOUS,
    NEAR,
    PROXIMAL,
    Borne,
    Columns,
    ConeKind,
    ConeRows,
    Members,
    Moduli,
    Rates,
    ScaledSystems,
    SystemPoints,
    missing_of,
)
from perfplast_fenicsx.rounding import TINY

SIZE = 3
"""Number of rows of a matrix, which is also its contribution to the degree of a program."""


def product(a: Floats, b: Floats) -> Floats:
    """Return Jordan's product (ab + ba)/2."""
    one = a @ b
    return np.asarray((one + np.swapaxes(one, -1, -2)) / 2, dtype=np.float64)


def least_eigenvalue(a: Floats) -> Floats:
    """Return each matrix's least eigenvalue, accurate relative to the norm, shape (...)."""
    mean = np.trace(a, axis1=-2, axis2=-1) / SIZE
    rest = a - mean[..., None, None] * np.eye(SIZE)
    size = np.sqrt(np.einsum("...ij,...ij->...", rest, rest) / 6)
    unit = rest / np.maximum(size, TINY)[..., None, None]
    cosine = np.clip(_determinant(unit) / 2, -1.0, 1.0)
    angle = (np.arccos(cosine) + 2 * np.pi) / 3
    found: Floats = mean + 2 * size * np.cos(angle)
    return found


def longest_step(a: Floats, da: Floats) -> float:
    """Return the largest t with a + t da semidefinite, if a is definite; ∞ without a limit."""
    if not a.size:
        return np.inf
    back = _lower_inverse(_factor(a))
    least = float(least_eigenvalue(back @ da @ np.swapaxes(back, -1, -2)).min())
    return -1 / least if least < 0 else np.inf


class MatrixScaling:
    """The scaling G of Nesterov and Todd: G⁻¹ s G⁻ᵀ = Gᵀ z G = Λ, for s and z inside the cones.

    Attributes:
        point: Diagonal of Λ, shape (..., 3).
    """

    def __init__(self, s: Floats, z: Floats) -> None:
        left = _factor(s)
        turned, self.point = _orthogonal_columns(np.swapaxes(_factor(z), -1, -2) @ left)
        root = np.sqrt(self.point)
        self._G = (left @ turned) / root[..., None, :]
        self._inverse = root[..., :, None] * (np.swapaxes(turned, -1, -2) @ _lower_inverse(left))

    def primal(self, s: Floats) -> Floats:
        """Return G⁻¹ s G⁻ᵀ."""
        return _congruent(self._inverse, s)

    def dual(self, z: Floats) -> Floats:
        """Return Gᵀ z G."""
        return _congruent(np.swapaxes(self._G, -1, -2), z)

    def undone(self, scaled: Floats) -> Floats:
        """Return the z whose :meth:`dual` is ``scaled``."""
        return _congruent(np.swapaxes(self._inverse, -1, -2), scaled)

    def quotient(self, a: Floats) -> Floats:
        """Return x whose Jordan product with Λ is a."""
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
    """Return the lower Cholesky factor; pivots that round to ≤ 0 become tiny."""
    L: Floats = np.zeros_like(a)
    for i in range(SIZE):
        rest = a[..., i:, i] - np.einsum("...ij,...j->...i", L[..., i:, :i], L[..., i, :i])
        L[..., i:, i] = rest / np.sqrt(np.maximum(rest[..., :1], TINY))
        L[..., i, i] = np.sqrt(np.maximum(rest[..., 0], TINY))
    return L


def _lower_inverse(L: Floats) -> Floats:
    found: Floats = np.zeros_like(L)
    for i in range(SIZE):
        found[..., i, i] = 1 / L[..., i, i]
        above = np.einsum("...k,...kj->...j", L[..., i, :i], found[..., :i, :i])
        found[..., i, :i] = -above * found[..., i, i, None]
    return found


def _orthogonal_columns(a: Floats) -> tuple[Floats, Floats]:
    """Return an orthogonal V for which aV has orthogonal columns, and the norms of these columns.

    The norms are the singular values. One-sided Jacobi rotations compute small singular values as
    accurately as large ones (J. Demmel, K. Veselić, SIAM J. Matrix Anal. Appl. 13 (1992), 1204).
    """
    columns = [a[..., i].copy() for i in range(SIZE)]
    turned = [np.broadcast_to(row, columns[0].shape).copy() for row in np.eye(SIZE)]
    # Largest number of rounds of Jacobi rotations. Usually four to six rounds are enough, because
    # each round squares the error.
    sweeps = 12
    orthogonal = 1e-14  # largest cosine between columns that count as orthogonal
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


@dataclass(frozen=True, eq=False)
class PrincipalCones:
    """Sets of principal stresses at points, in the coordinates (p, s) of :mod:`standard_cones`.

    Attributes:
        at: Indices of the points, shape (num,).
        bounds: Bounds b > 0 (stress), shape (num,).
        sines: Sines s in [0, 1), shape (num,).
        tensions: Tensile strengths f > 0 (stress), ∞ without such a limit, shape (num,).
        tensors: Unit tensor and orthonormal deviators, shape (1 + k, 3, 3). The coefficients of
            these tensors in a stress are p and the first k components of s. Further components of s
            belong to sets of other kinds.
        flat: Whether out-of-plane rates are zero; the out-of-plane stress is then the mean of the
            in-plane stresses.
    """

    at: Longs
    bounds: Floats
    sines: Floats
    tensions: Floats
    tensors: Floats
    flat: bool = False

    @classmethod
    def none(cls) -> "PrincipalCones":
        """Return cones without any point."""
        nothing: Floats = np.zeros(0)
        return cls(np.zeros(0, dtype=np.int64), nothing, nothing, nothing, np.zeros((1, 3, 3)))

    @property
    def count(self) -> int:
        """Return the number of points."""
        return len(self.at)

    @property
    def cut(self) -> npt.NDArray[np.bool_]:
        """Return flags of the points with a tensile strength, shape (num,)."""
        return np.isfinite(self.tensions)

    @property
    def grows(self) -> npt.NDArray[np.bool_]:
        """Return flags of points with a bounded mean stress, which dilate, shape (num,)."""
        return (self.sines > 0) | self.cut

    def those(self, chosen: npt.NDArray[np.bool_] | Longs) -> "PrincipalCones":
        """Return the cones of some of the points.

        Args:
            chosen: Flags of shape (num,), or indices among the points.
        """
        numbers = {name: getattr(self, name)[chosen] for name in ("bounds", "sines", "tensions")}
        return replace(self, at=self.at[chosen], **numbers)

    def scaled(self, factors: Floats) -> "PrincipalCones":
        """Return the cones with each b multiplied by its point's entry of ``factors`` (count,)."""
        return replace(self, bounds=self.bounds * factors[self.at])

    def block(self, unit: float, weights: Floats) -> "PrincipalPoints":
        """See :meth:`cone.PointSets.block`."""
        bounds, tensions = (np.asarray(of / unit) for of in (self.bounds, self.tensions))
        return PrincipalPoints(replace(self, bounds=bounds, tensions=tensions), weights)

    @property
    def caps(self) -> Floats:
        """See :meth:`cone.PointSets.caps`."""
        return self.tensions

    def ratios(self, pressure: Floats, deviator: Floats) -> Floats:
        """Return the yield ratios of stresses, shape (num,); ≤ 0 if no positive multiple yields.

        Args:
            pressure: Mean stress p at all points, shape (count,).
            deviator: Deviator s at all points, shape (count, m).
        """
        d = np.linalg.eigvalsh(self.deviators(deviator))
        along = (1 + self.sines) * d[:, 2] - (1 - self.sines) * d[:, 0]
        found: Floats = (along + 2 * self.sines * pressure[self.at]) / self.bounds
        pulled = (pressure[self.at] + d[:, 2]) / self.tensions  # 0 without a tensile strength
        return np.where(self.cut, np.maximum(found, pulled), found)

    def powers(self, trace: Floats, deviator: Floats) -> Floats:
        """Return the dissipation of admissible rates per volume, shape (num,).

        Args:
            trace: Trace tr ε at all points, shape (count,).
            deviator: Deviator of ε at all points, shape (count, m).
        """
        of_trace, of_sizes = self.factors
        found: Floats = of_trace * trace[self.at] + of_sizes * self.sizes(trace, deviator)
        return found

    @property
    def factors(self) -> tuple[Floats, Floats]:
        """Return the coefficients of tr ε and Σ|ε_i| in :meth:`powers`, shape (num,) each."""
        steep, cut = self.sines > 0, self.cut
        of_trace = np.where(steep, self.bounds / np.where(steep, 2 * self.sines, 1.0), 0.0)
        of_sizes = np.where(steep, 0.0, self.bounds / 2)
        tensions = self.tensions[cut]
        half = (self.bounds[cut] / 2 - self.sines[cut] * tensions) / (1 - self.sines[cut])
        of_trace[cut], of_sizes[cut] = tensions - half, half
        return of_trace, of_sizes

    def lacking(self, trace: Floats, deviator: Floats) -> Floats:
        """Return the amount by which tr ε is below s Σ|ε_i|, shape (num,); see :meth:`powers`."""
        found: Floats = np.maximum(self.sines * self.sizes(trace, deviator) - trace[self.at], 0.0)
        return found

    def sizes(self, trace: Floats, deviator: Floats) -> Floats:
        """Return Σ|ε_i| for :meth:`powers`, shape (num,); without tr ε where p is unbounded."""
        unit = np.diag([1.0, 1.0, 0.0 if self.flat else 1.0])
        means = np.where(self.grows, trace[self.at], 0.0) / np.trace(unit)
        values = np.linalg.eigvalsh(self.deviators(deviator) + means[:, None, None] * unit)
        found: Floats = np.abs(values).sum(axis=1)
        return found

    def deviators(self, deviator: Floats) -> Floats:
        """Return the deviators as tensors, shape (num, 3, 3), from s at all points."""
        components = deviator[self.at, : len(self.tensors) - 1]
        found: Floats = np.einsum("nj,jab->nab", components, self.tensors[1:])
        return found


class PrincipalPoints(SystemPoints):
    """Points with bounds on principal stresses; see :class:`cone.Block`.

    A point has two matrices, or three if at least one of the rank's points has a tensile strength.
    If the point itself has no tensile strength, its third matrix is constant.

    Attributes:
        cones: Cones of the points.
        weights: Weights w, shape (num,).
    """

    longest = staticmethod(longest_step)

    def __init__(self, cones: PrincipalCones, weights: Floats) -> None:
        """Compute the coefficients of t, p and the deviator in X_k, the constants and the centre.

        Args:
            cones: Cones of the points, in the units of the program.
            weights: Weights w, shape (num,).
        """
        self.cones, self.weights = cones, weights
        self.at, self.size = cones.at, len(cones.tensors) - 1
        s, one, none = cones.sines, np.ones(cones.count), np.zeros(cones.count)
        cut = np.where(cones.cut, one, none)
        half = cones.bounds / 2
        self._pressures: Floats = -half * cut
        middle = half * (1 + s * cut)
        columns = [(one, none, -(1 + s), none, middle), (-one, -2 * s, 1 - s, 2 * half, middle)]
        if cut.any():
            tensions = np.where(cones.cut, cones.tensions, half)
            columns.append((none, -cut, -cut, tensions, tensions - self._pressures))
        parts = (np.stack(of, axis=1) for of in zip(*columns, strict=True))
        of_t, of_p, self._of_d, constants, self._rooms = parts
        self._of_heads: Floats = np.stack([of_t, of_p], axis=1)
        self.constants = constants[:, :, None, None] * np.eye(SIZE)
        # squares of the multiples of I at the centre, limited
        self._viscosities: Floats = np.minimum(self._rooms**2, MOST_VISCOUS)

    @property
    def degree(self) -> int:
        """Return the total number of rows of all matrices."""
        return SIZE * self._of_d.size

    def changes(self, y: Floats) -> Floats:
        """Return the change of X, shape (num, k, 3, 3); see :meth:`cone.SystemPoints.changes`."""
        return self._matrices(np.einsum("nik,ni->nk", self._of_heads, y[:, :2]), y[:, 2:])

    def _matrices(self, heads: Floats, tails: Floats) -> Floats:
        """Return heads I + d_k Σ tails D, with the tensors D of the components of s.

        Args:
            heads: Multiples of I, shape (num, k).
            tails: Components, shape (num, m).
        """
        tensors = np.einsum("nj,jab->nab", tails, self.cones.tensors[1:])
        found: Floats = heads[:, :, None, None] * np.eye(SIZE)
        found += self._of_d[:, :, None, None] * tensors[:, None]
        return found

    def flow(self, moduli: Moduli) -> None:
        """Write the moduli for matrices that are multiples of the unit tensor.

        See :meth:`cone.Block.flow`.
        """
        grows, squares = self.cones.grows, self._viscosities
        # for the t with which the first two matrices are equal
        of_p = self._of_heads[:, 1].copy()
        of_p[:, :2] = of_p[:, :2].mean(axis=1, keepdims=True)
        soft = SIZE * (of_p**2 / squares).sum(axis=1)
        at, loose = self.cones.at, 1 / PROXIMAL
        moduli.bulk[at] = np.where(grows, 1 / np.where(grows, soft, 1.0), loose)
        moduli.a[at] = 1 / (self._of_d**2 / squares).sum(axis=1)

    def start(self, borne: Borne) -> Members:
        """Write the mean stresses at the centre of the sets; return the members at the centre."""
        borne.pressure[self.cones.at] = self._pressures
        apart = self._rooms / self._viscosities
        X, Z = (of[:, :, None, None] * np.eye(SIZE) for of in (self._rooms, apart))
        return Members(X, Z, self._rooms[:, 0].copy())

    def rows(self, at: Columns) -> ConeRows:
        """See :meth:`cone.MatrixBlock.rows`; the matrices of a point are consecutive."""
        tensors, (count, many) = self.cones.tensors, self._of_d.shape
        columns = self.chosen(at.own, at.pressure, at.deviator)
        scaled = np.broadcast_to(tensors, (count, many, *tensors.shape))
        factors = self.columns(scaled).reshape(count * many, -1, columns.shape[1])
        right = vectors(self.constants).reshape(count * many, -1)
        return ConeRows(ConeKind.SEMIDEFINITE, right, np.repeat(columns, many, axis=0), factors)

    def from_rows(self, static: Floats, kinematic: Floats, own: Floats) -> Members:
        """See :meth:`cone.MatrixBlock.from_rows`."""
        shape = (*self._of_d.shape, SIZE, SIZE)
        return Members(matrices(static).reshape(shape), matrices(kinematic).reshape(shape), own)

    def raised(self, products: Floats, by: float) -> Floats:
        """See :meth:`cone.Block.raised`."""
        found: Floats = products + by * np.eye(SIZE)
        return found

    def missing(self, products: Floats, mu: float) -> Floats:
        """See :meth:`cone.Block.missing`."""
        found = np.zeros_like(products)
        near = 1 + 1e-6  # most matrices need no change, and extreme eigenvalues show this quickly
        least, most = least_eigenvalue(products), -least_eigenvalue(-products)
        far = (least < near * NEAR * mu) | (most * near > mu / NEAR)
        values, axes = np.linalg.eigh(products[far])
        found[far] = (axes * missing_of(values, mu)[..., None, :]) @ np.swapaxes(axes, -1, -2)
        return found

    def scaled(self, now: Members, rates: Rates) -> "ScaledPrincipal":
        """Return these points at an iterate, with the scaling of their cones."""
        return ScaledPrincipal(self, now, rates)

    def columns(self, primal: Floats) -> Floats:
        """Return the columns of G for (t, p, s), with the members as Mandel vectors.

        Args:
            primal: Unit tensor and deviators in the scaling of each member, shape (num, k, 1 + m,
                3, 3).

        Returns:
            Shape (num, 6k, 2 + m).
        """
        numbers = vectors(primal)
        heads = np.swapaxes(self._of_heads, 1, 2)[..., None] * numbers[:, :, :1]
        tails = self._of_d[:, :, None, None] * numbers[:, :, 1:]
        found = np.concatenate([heads, tails], axis=2)
        return np.swapaxes(found, 2, 3).reshape(len(found), -1, found.shape[2])

    def works(self, kinematic: Floats) -> Floats:
        """See :meth:`cone.SystemPoints.works`."""
        traces = np.trace(kinematic, axis1=2, axis2=3)
        deviators = np.einsum("nkab,jab->nkj", kinematic, self.cones.tensors[1:])
        heads = np.einsum("nik,nk->ni", self._of_heads, traces)
        return np.hstack([heads, np.einsum("nk,nkj->nj", self._of_d, deviators)])

    def least(self, works: Floats) -> Floats:
        """Return the smallest z with given :meth:`works`; an unbounded p adds no condition."""
        grows, both = self.cones.grows, self._of_heads
        grid = SIZE * both @ np.swapaxes(both, 1, 2)
        grid[~grows, 1, 1] = 1.0
        right = works[:, :2].copy()
        right[~grows, 1] = 0.0
        heads = (np.linalg.solve(grid, right[:, :, None])[:, :, 0][:, None] @ both)[:, 0]
        tails = works[:, 2:] / (self._of_d**2).sum(axis=1)[:, None]
        return self._matrices(heads, tails)


class ScaledPrincipal(ScaledSystems):
    """Points with principal stresses at an iterate; see :class:`cone.ScaledBlock`."""

    def __init__(self, block: PrincipalPoints, now: Members, rates: Rates) -> None:
        """Compute the scaling, and factorise the system of each point."""
        scaling, cones = MatrixScaling(now.static, now.kinematic), block.cones
        columns = block.columns(np.stack([scaling.primal(it) for it in cones.tensors], axis=2))
        soft = np.zeros((cones.count, 1, columns.shape[2]))
        soft[:, 0, 1] = np.where(cones.grows, 0.0, np.sqrt(PROXIMAL))
        super().__init__(block, scaling, np.concatenate([columns, soft], axis=1), now, rates)

    def products(self, change: Members | None = None) -> Floats:
        """See :meth:`cone.ScaledBlock.products`."""
        if change is None:
            found: Floats = self.scaling.point[..., None] ** 2 * np.eye(SIZE)
            return found
        return product(self.scaling.primal(change.static), self.scaling.dual(change.kinematic))

    def aim(self, products: Floats) -> tuple[Floats, Floats]:
        """See :class:`cone.ScaledSystems`."""
        aim = self.scaling.quotient(products)
        return aim, vectors(aim).reshape(len(aim), -1)
