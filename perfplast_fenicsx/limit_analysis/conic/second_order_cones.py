"""Implement second-order cones a₀ ≥ ‖a'‖, and blocks of points with one cone each, in NumPy.

Members are rows (a₀, a') of arrays of shape (num_cones, 1 + m). Notation and formulas follow E. D.
Andersen, C. Roos, T. Terlaky, On implementing a primal-dual interior-point method for conic
quadratic optimization, Math. Program. 95 (2003), 249.

The static member of a point is (γ − αp, s + γt). Its kinematic member is (d, −w dev ε) with the
weight w of the point. If α = 0 (:class:`Cylinders`), nothing bounds p, and d ≥ w‖dev ε‖ is an
unknown. If α > 0 (:class:`Cones`), bodies dilate, and d = w tr ε/α. With the scaling W of Nesterov
and Todd, static members change by dS = W r − W² dz if the products change by W z ∘ r.

The gauge and the support function belong to the set ‖s + γt‖ ≤ γ − αp (:mod:`standard_cones`). With
ρ² = 1 − ‖t‖², a set with t ≠ 0 (which has α = 0) is √(‖s‖² + (t·s)²/ρ²) + t·s/ρ ≤ γρ.
"""

from dataclasses import replace
from typing import Protocol

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.conic.cone import (
    MOST_VISCOUS,
    NO_OWN,
    Borne,
    Columns,
    ConeKind,
    ConeRows,
    Members,
    Moduli,
    Places,
    PointSets,
    Rates,
    missing_of,
)
from perfplast_fenicsx.rounding import TINY


def determinant(a: Floats) -> Floats:
    """Return a₀² − ‖a'‖², shape (num_cones,), at least ``TINY``."""
    size = np.sqrt(np.einsum("ni,ni->n", a[:, 1:], a[:, 1:]))
    return np.maximum((a[:, 0] - size) * (a[:, 0] + size), TINY)


def product(a: Floats, b: Floats) -> Floats:
    """Return Jordan's product (a·b, a₀ b' + b₀ a')."""
    head = np.einsum("ni,ni->n", a, b)[:, None]
    return np.hstack([head, a[:, :1] * b[:, 1:] + b[:, :1] * a[:, 1:]])


def quotient(a: Floats, b: Floats) -> Floats:
    """Return x with product(a, x) = b, for a inside the cone."""
    inner = np.einsum("ni,ni->n", a[:, 1:], b[:, 1:])
    head = ((a[:, 0] * b[:, 0] - inner) / determinant(a))[:, None]
    return np.hstack([head, (b[:, 1:] - head * a[:, 1:]) / a[:, :1]])


def longest_step(a: Floats, da: Floats) -> float:
    """Return the largest t with a + t da in the cones, if a is inside; ∞ without a limit."""
    if not len(a):
        return np.inf
    # the smallest positive root of A t² + 2 B t + C, in a form without cancellation
    square = da[:, 0] ** 2 - np.einsum("ni,ni->n", da[:, 1:], da[:, 1:])
    half = a[:, 0] * da[:, 0] - np.einsum("ni,ni->n", a[:, 1:], da[:, 1:])
    least = determinant(a)
    discriminant = half**2 - square * least
    divisor = np.sqrt(np.maximum(discriminant, 0)) - half
    leaves = (discriminant >= 0) & (divisor > 0) & ((square < 0) | (half < 0))
    steps = np.full(len(a), np.inf)
    np.divide(least, divisor, out=steps, where=leaves)
    return float(steps.min())


class Scaling:
    """The scaling W of Nesterov and Todd, W z = W⁻¹ s (``point``), for s and z inside the cones.

    W = η (w₀, w'ᵀ; w', I + w' w'ᵀ/(1 + w₀)) with w₀² − ‖w'‖² = 1.

    Attributes:
        point: W z, shape (num_cones, 1 + m).
    """

    def __init__(self, s: Floats, z: Floats) -> None:
        size_s, size_z = np.sqrt(determinant(s)), np.sqrt(determinant(z))
        unit_s, unit_z = s / size_s[:, None], z / size_z[:, None]
        mean = np.sqrt((1 + np.einsum("ni,ni->n", unit_s, unit_z)) / 2)
        unit_z[:, 1:] *= -1
        w = (unit_s + unit_z) / (2 * mean)[:, None]
        self._eta = np.sqrt(size_s / size_z)
        self._w0, self._w = w[:, 0], w[:, 1:]
        self.point = self.apply(z)

    def apply(self, a: Floats) -> Floats:
        """Return W a."""
        return self._boost(a, self._w) * self._eta[:, None]

    def invert(self, a: Floats) -> Floats:
        """Return W⁻¹ a."""
        return self._boost(a, -self._w) / self._eta[:, None]

    primal = undone = invert

    def _boost(self, a: Floats, w: Floats) -> Floats:
        inner = np.einsum("ni,ni->n", w, a[:, 1:])
        head = self._w0 * a[:, 0] + inner
        along = a[:, 0] + inner / (1 + self._w0)
        return np.hstack([head[:, None], a[:, 1:] + along[:, None] * w])

    def moduli(self) -> tuple[Floats, Floats]:
        """Return a and N, where a I − N Nᵀ is the inverse of the block of W⁻² for a'.

        Returns:
            Coefficient a, shape (num_cones,); N, shape (num_cones, m).
        """
        size2 = np.einsum("ni,ni->n", self._w, self._w)
        scale = self._eta * np.sqrt(2 / (1 + 2 * size2))
        return self._eta**2, scale[:, None] * self._w

    def coupled(self, slopes: Floats) -> tuple[Floats, Floats]:
        """Return κ and b of the term κ(t − b·x)² that a₀ = −αp adds to :meth:`moduli`.

        Args:
            slopes: Slopes α > 0, shape (num_cones,).

        Returns:
            Coefficient κ, shape (num_cones,); b, shape (num_cones, m). The rates are (t, x).
        """
        size2 = 1 + 2 * np.einsum("ni,ni->n", self._w, self._w)
        along = (2 * slopes * self._w0 / size2)[:, None] * self._w
        return self._eta**2 * size2 / slopes**2, along


class SecondOrderMembers:
    """The common part of blocks with members in second-order cones; see :class:`cone.Block`."""

    longest = staticmethod(longest_step)

    def from_rows(self, static: Floats, kinematic: Floats, own: Floats) -> Members:
        """See :meth:`cone.MatrixBlock.from_rows`."""
        return Members(static, kinematic, own)

    def raised(self, products: Floats, by: float) -> Floats:
        """See :meth:`cone.Block.raised`."""
        found = products.copy(order="K")
        found[:, 0] += by
        return found

    def missing(self, products: Floats, mu: float) -> Floats:
        """See :meth:`cone.Block.missing`."""
        size = np.linalg.norm(products[:, 1:], axis=1)
        low, high = (missing_of(products[:, 0] + s * size, mu) for s in (-1, 1))
        found = np.empty_like(products)
        found[:, 0] = (low + high) / 2
        share = (high - low) / 2 / np.maximum(size, TINY)
        found[:, 1:] = share[:, None] * products[:, 1:]
        return found


class _Points(SecondOrderMembers):
    """The common part of :class:`Cylinders` and :class:`Cones`; see :class:`cone.Block`."""

    def __init__(
        self,
        at: Places,
        radii: Floats,
        strengths: Floats,
        weights: Floats,
        slopes: Floats,
        tilts: Floats | None = None,
    ) -> None:
        """Store the data of the points, in the units of the program.

        Args:
            at: Indices of the points.
            radii: Yield radii γ, shape (num,).
            strengths: Sizes of the strengths, about 1, shape (num,). With little or no cohesion, γ
                may be much smaller.
            weights: Weights w, shape (num,).
            slopes: Slopes α, shape (num,).
            tilts: Tilts t, shape (num, m), zero where α > 0; None if all tilts are zero.
        """
        self.at, self.radii, self.strengths, self.weights = at, radii, strengths, weights
        self.slopes = slopes
        self._middles = None if tilts is None else radii[:, None] * tilts
        self._viscosities = np.minimum(strengths**2, MOST_VISCOUS)

    @property
    def degree(self) -> int:
        """Return the number of points."""
        return len(self.radii)

    def start(self, borne: Borne) -> Members:
        """Return the members at the stress that ``borne`` contains."""
        static = self.static(borne, NO_OWN)
        kinematic = np.zeros_like(static)
        kinematic[:, 0] = self.strengths / self._viscosities
        return Members(static, kinematic)

    def flow(self, moduli: Moduli) -> None:
        """See :meth:`cone.Block.flow`."""
        moduli.a[self.at] = self._viscosities

    def static(self, borne: Borne, own: Floats) -> Floats:
        """Return (γ − αp, s + γt), shape (num, 1 + m)."""
        heads = self.radii - self.slopes * borne.pressure[self.at]
        tails = np.asfortranarray(borne.deviator[self.at])
        if self._middles is not None:
            tails = tails + self._middles
        return np.column_stack([heads, tails])

    def rows(self, at: Columns) -> ConeRows:
        """See :meth:`cone.MatrixBlock.rows`."""
        columns = np.column_stack([at.pressure[self.at], at.deviator[self.at]])
        right = np.zeros(columns.shape)
        right[:, 0] = self.radii
        if self._middles is not None:
            right[:, 1:] = self._middles
        factors = np.tile(np.eye(columns.shape[1]), (len(columns), 1, 1))
        factors[:, 0, 0] = -self.slopes
        return ConeRows(ConeKind.SECOND_ORDER, right, columns, factors)


class Cylinders(_Points):
    """Points with ‖s + γt‖ ≤ γ and with unbounded p; see :class:`cone.Block`."""

    def scaled(self, now: Members, rates: Rates) -> "ScaledCylinders":
        """Return these points at an iterate, with the scaling of their cones."""
        return ScaledCylinders(self, now, rates)


class Cones(_Points):
    """Points with ‖s‖ ≤ γ − αp and α > 0; see :class:`cone.Block`."""

    def start(self, borne: Borne) -> Members:
        """Write mean stresses with γ − αp equal to the size of the strength; return the members."""
        borne.pressure[self.at] = -(self.strengths - self.radii) / self.slopes
        return super().start(borne)

    def flow(self, moduli: Moduli) -> None:
        """See :meth:`cone.Block.flow`."""
        super().flow(moduli)
        moduli.bulk[self.at] = self._viscosities / self.slopes**2

    def rates(self, rates: Rates) -> Floats:
        """Return (w tr ε/α, −w dev ε), shape (num, 1 + m)."""
        heads = self.weights * rates.trace[self.at] / self.slopes
        return np.column_stack([heads, -self.weights[:, None] * rates.deviator[self.at]])

    def scaled(self, now: Members, rates: Rates) -> "ScaledCones":
        """Return these points at an iterate, with the scaling of their cones."""
        return ScaledCones(self, now, rates)


class ScaledMembers:
    """The scaling of second-order members at an iterate; see :class:`cone.ScaledBlock`.

    Attributes:
        scaling: Scaling W of the members.
    """

    def __init__(self, now: Members) -> None:
        self.scaling = Scaling(now.static, now.kinematic)

    def products(self, change: Members | None = None) -> Floats:
        """See :meth:`cone.ScaledBlock.products`."""
        if change is None:
            return product(self.scaling.point, self.scaling.point)
        scaled = self.scaling.invert(change.static), self.scaling.apply(change.kinematic)
        return product(*scaled)


class ScaledCylinders(ScaledMembers):
    """:class:`Cylinders` at an iterate, with their scaling; see :class:`cone.ScaledBlock`."""

    def __init__(self, block: Cylinders, now: Members, rates: Rates) -> None:
        super().__init__(now)
        self._at, self._weights = block.at, block.weights[:, None]
        self._a, self._normal = self.scaling.moduli()
        self._off = now.kinematic[:, 1:] + self._weights * rates.deviator[self._at]

    def stiffen(self, moduli: Moduli) -> Moduli:
        """See :meth:`cone.ScaledBlock.stiffen`."""
        moduli.a[self._at], moduli.normal[self._at] = self._a, self._normal
        return moduli

    def aim(self, products: Floats) -> tuple[Floats, Floats]:
        """Return r, and the part of W⁻¹r that belongs to the deviator."""
        aim = quotient(self.scaling.point, products)
        return aim, self.scaling.invert(aim)[:, 1:]

    def bear(self, aim: tuple[Floats, Floats], change: Borne) -> None:
        """See :meth:`cone.ScaledBlock.bear`."""
        change.deviator[self._at] = self._stress(aim[1] + self._off)

    def follow(self, aim: tuple[Floats, Floats], rates: Rates, change: Borne) -> Members:
        """See :meth:`cone.ScaledBlock.follow`."""
        scaled, unscaled = aim
        tails = -self._off - self._weights * rates.deviator[self._at]
        stress = self._stress(unscaled - tails)
        change.deviator[self._at] = stress
        static, kinematic = np.zeros_like(scaled), np.zeros_like(scaled)
        static[:, 1:] = stress
        kinematic[:, 0] = self.scaling.invert(scaled - self.scaling.invert(static))[:, 0]
        kinematic[:, 1:] = tails
        return Members(static, kinematic)

    def resist(self, rates: Rates, change: Borne) -> Floats:
        """See :meth:`cone.ScaledBlock.resist`."""
        change.deviator[self._at] = self._stress(self._weights * rates.deviator[self._at])
        return NO_OWN

    def _stress(self, x: Floats) -> Floats:
        """Return the moduli times x."""
        along = np.einsum("ni,ni->n", self._normal, x)
        found: Floats = self._a[:, None] * x - along[:, None] * self._normal
        return found


class ScaledCones(ScaledMembers):
    """:class:`Cones` at an iterate, with their scaling; see :class:`cone.ScaledBlock`.

    The moduli are W², and p changes by dp = −dS₀/α.
    """

    def __init__(self, block: Cones, now: Members, rates: Rates) -> None:
        super().__init__(now)
        self._block, self._at = block, block.at
        self._off = now.kinematic - block.rates(rates)

    def stiffen(self, moduli: Moduli) -> Moduli:
        """See :meth:`cone.ScaledBlock.stiffen`."""
        along = np.zeros_like(moduli.normal) if moduli.along is None else moduli.along
        moduli.a[self._at], moduli.normal[self._at] = self.scaling.moduli()
        moduli.bulk[self._at], along[self._at] = self.scaling.coupled(self._block.slopes)
        return replace(moduli, along=along)

    def aim(self, products: Floats) -> Floats:
        """Return r with W z ∘ r = ``products``."""
        return quotient(self.scaling.point, products)

    def bear(self, aim: Floats, change: Borne) -> None:
        """See :meth:`cone.ScaledBlock.bear`."""
        self._put(self._static(-self._off, aim), change)

    def follow(self, aim: Floats, rates: Rates, change: Borne) -> Members:
        """See :meth:`cone.ScaledBlock.follow`."""
        kinematic = self._block.rates(rates) - self._off
        static = self._static(kinematic, aim)
        self._put(static, change)
        return Members(static, kinematic)

    def resist(self, rates: Rates, change: Borne) -> Floats:
        """See :meth:`cone.ScaledBlock.resist`."""
        self._put(self._static(self._block.rates(rates)), change)
        return NO_OWN

    def _static(self, kinematic: Floats, aim: Floats | None = None) -> Floats:
        """Return W(r − W dz), the change of static members, shape (num, 1 + m)."""
        scaled = -self.scaling.apply(kinematic)
        return self.scaling.apply(scaled if aim is None else scaled + aim)

    def _put(self, static: Floats, change: Borne) -> None:
        change.pressure[self._at] = -static[:, 0] / self._block.slopes
        change.deviator[self._at] = static[:, 1:]


class ConesAtPoints(Protocol):
    """The cone of each point, ‖s + γt‖ ≤ γ − αp.

    Attributes:
        radii: Yield radius γ (stress) at zero mean stress, ∞ in elastic bodies, shape (count,).
        slopes: Slope α, by which the radius decreases with the mean stress, shape (count,).
        tilts: Tilt t, shape (count, m); None if all tilts are zero.
        sets: Yield sets of other kinds, one entry for each kind. At the points of these sets, γ and
            α describe a second-order cone that encloses the set.
    """

    radii: Floats
    slopes: Floats
    tilts: Floats | None
    sets: tuple[PointSets, ...]


def yield_ratios(cones: ConesAtPoints, pressure: Floats, deviator: Floats) -> Floats:
    """Return the yield ratios of a stress, shape (count,): 1 on the surface of the yield set.

    With cohesion, the ratio is zero or negative if no positive multiple of the stress yields.
    Without cohesion (γ = 0), all multiples of a yielding stress yield. The ratio is then ‖s‖/(−αp),
    the steepness of the stress relative to the cone.

    Args:
        cones: The cones.
        pressure: Mean stress p, shape (count,).
        deviator: Deviator s, shape (count, m).
    """
    sizes = np.linalg.norm(deviator, axis=1) + cones.slopes * pressure
    loose = cones.radii == 0
    ratios: Floats = sizes / np.where(loose, 1.0, cones.radii)
    if loose.any():
        ratios[loose] = _steepness(cones.slopes[loose] * pressure[loose], deviator[loose])
    if cones.tilts is not None:
        tilts = cones.tilts
        square = 1 - np.einsum("ni,ni->n", tilts, tilts)
        along = np.einsum("ni,ni->n", tilts, deviator)
        length2 = np.einsum("ni,ni->n", deviator, deviator)
        tilted = (np.sqrt(length2 + along**2 / square) + along / np.sqrt(square)) / np.sqrt(square)
        there = tilts.any(axis=1)
        ratios[there] = (tilted / cones.radii)[there]
    for it in cones.sets:
        ratios[it.at] = it.ratios(pressure, deviator)
    return ratios


def _steepness(heads: Floats, deviator: Floats) -> Floats:
    """Return ‖s‖/(−αp): 0 at zero stress, and ∞ at other stresses with p ≥ 0."""
    sizes, rest = np.linalg.norm(deviator, axis=1), (heads <= 0) & ~deviator.any(axis=1)
    found: Floats = np.divide(sizes, -heads, out=np.full_like(sizes, np.inf), where=heads < 0)
    found[rest] = 0.0
    return found


def own_strengths(cones: ConesAtPoints, pressure: Floats) -> Floats:
    """Return the strengths by which residuals are divided: γ, or −αp at cohesionless points.

    A tensile strength is an upper limit of the result.

    Args:
        cones: The cones.
        pressure: Mean stress p (stress), shape (count,).

    Returns:
        Strengths (stress), shape (count,). They are ∞ in elastic bodies, and at cohesionless points
        where p is not compressive.
    """
    heads = -cones.slopes * pressure
    own = np.where(heads > 0, heads, np.inf)
    found: Floats = np.where(cones.radii > 0, cones.radii, own)
    for it in cones.sets:
        found[it.at] = np.minimum(found[it.at], it.caps)
    return found


def powers(cones: ConesAtPoints, trace: Floats, deviator: Floats) -> Floats:
    """Return the dissipation of admissible strain rates per volume, shape (count,).

    Args:
        cones: The cones.
        trace: Component ε'₀, shape (count,).
        deviator: Components ε'₁, shape (count, m).
    """
    rates = np.linalg.norm(deviator, axis=1)
    np.divide(trace, cones.slopes, out=rates, where=cones.slopes > 0)
    if cones.tilts is not None:
        rates -= np.einsum("ni,ni->n", cones.tilts, deviator)
    found: Floats = np.where(np.isfinite(cones.radii), cones.radii, 0.0) * rates
    for it in cones.sets:
        found[it.at] = it.powers(trace, deviator)
    return found
