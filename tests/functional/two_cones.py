"""Ground with two intersecting cones: a kind of cone in one file, as in a separate package.

‖s‖ ≤ γ_k − α_k p for k = 1, 2 with α₂ = 2α₁. A point has the members x_k = (γ_k − α_k p, s), which
are linear in y = (p, s), x = h + Gy, and multipliers z_k with −Gᵀz = w(tr ε, dev ε). With the
scaling W of Nesterov and Todd the stress changes by dy = H⁻¹(GᵀW⁻¹r + Gᵀz + w(ε + dε)), H = GᵀW⁻²G,
where r is the required change of the products W z ∘ x.
"""

import math
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from perfplast_fenicsx import DruckerPrager
from perfplast_fenicsx.limit_analysis.conic.cone import MOST_VISCOUS, NO_OWN, Members
from perfplast_fenicsx.limit_analysis.conic.second_order_cones import (
    ScaledMembers,
    SecondOrderMembers,
    quotient,
)
from perfplast_fenicsx.materials.drucker_prager import DruckerPragerLaw, DruckerPragerSet
from perfplast_fenicsx.materials.laws import MATERIALS
from perfplast_fenicsx.materials.mandel import Expr, numbers_of


@dataclass(frozen=True)
class TwoCones:
    """The set of a law; see :class:`LawSet`.

    Attributes:
        radii: γ_k (stress).
        slopes: α_k.
    """

    radii: tuple[float, float]
    slopes: tuple[float, float]

    def around(self, flat):
        """The first cone."""
        return self.radii[0], self.slopes[0]

    def at_points(self, at, tensors, flat):
        """See :meth:`LawSet.at_points`."""
        return Sets(self, at, len(tensors) - 1)


@dataclass(frozen=True, eq=False)
class Sets:
    """The set at points with m components of s; see :class:`PointSets`."""

    of: TwoCones
    at: np.ndarray
    m: int

    @property
    def caps(self):
        """Return the mean stress at the apex of the second cone."""
        return np.full(len(self.at), self.of.radii[1] / self.of.slopes[1])

    def those(self, chosen):
        return replace(self, at=self.at[chosen])

    def ratios(self, pressure, deviator):
        sizes = np.linalg.norm(deviator[self.at, : self.m], axis=1)
        both = zip(self.of.radii, self.of.slopes, strict=True)
        return np.max([(sizes + a * pressure[self.at]) / c for c, a in both], axis=0)

    def powers(self, trace, deviator):
        """Return Σ γ_k z_k for the cheapest z with Σ α_k z_k = tr ε and Σ z_k ≥ ‖dev ε‖."""
        sizes, grows = np.linalg.norm(deviator[self.at, : self.m], axis=1), trace[self.at]
        (c, d), (a, b) = self.of.radii, self.of.slopes
        first = np.maximum((b * sizes - grows) / (b - a), 0.0)
        return c * first + d * (grows - a * first) / b

    def lacking(self, trace, deviator):
        sizes = np.linalg.norm(deviator[self.at, : self.m], axis=1)
        return np.maximum(self.of.slopes[0] * sizes - trace[self.at], 0.0)

    def block(self, unit, weights):
        return Points(self, np.array(self.of.radii) / unit, weights)


class Points(SecondOrderMembers):
    """The points in a program; see :class:`Block`. Members have the shape (2 num, 1 + m)."""

    def __init__(self, sets, radii, weights):
        self.at, self.m, self.weights = sets.at, sets.m, weights
        self.radii, self.slopes = radii, np.array(sets.of.slopes)
        self._squares = np.minimum(radii**2, MOST_VISCOUS)

    @property
    def degree(self):
        return 2 * len(self.at)

    def start(self, borne):
        static = self.static(borne, NO_OWN)
        kinematic = np.zeros_like(static)
        kinematic[:, 0] = np.tile(self.radii / self._squares, len(self.at))
        return Members(static, kinematic)

    def flow(self, moduli):
        moduli.bulk[self.at] = 1 / (self.slopes**2 / self._squares).sum()
        moduli.a[self.at] = 1 / (1 / self._squares).sum()

    def static(self, borne, own):
        heads = self.radii - np.outer(borne.pressure[self.at], self.slopes)
        tails = np.repeat(borne.deviator[self.at, : self.m], 2, axis=0)
        return np.column_stack([heads.ravel(), tails])

    def scaled(self, now, rates):
        return ScaledPoints(self, now, rates)


class ScaledPoints(ScaledMembers):
    """The points at an iterate; see :class:`ScaledBlock`."""

    def __init__(self, block, now, rates):
        super().__init__(now)
        self._block = block
        num, size = len(block.at), 1 + block.m
        self._G = np.zeros((num, 2, size, size))  # rows of members, columns of (p, s)
        self._G[:, :, 0, 0] = -block.slopes
        self._G[:, :, 1:, 1:] = np.eye(block.m)
        columns = [self.scaling.invert(self._G[..., j].reshape(-1, size)) for j in range(size)]
        self._columns = np.stack(columns, axis=2).reshape(num, 2 * size, size)
        self._roots = np.linalg.inv(np.linalg.qr(self._columns, mode="r"))
        self._off = self._works(now.kinematic) + self._rates(rates)

    def _works(self, kinematic):
        """Return Gᵀz, shape (num, 1 + m)."""
        z = kinematic.reshape(len(self._G), 2, -1)
        return np.einsum("nkij,nki->nj", self._G, z)

    def _rates(self, rates):
        at, m = self._block.at, self._block.m
        rows = np.column_stack([rates.trace[at], rates.deviator[at, :m]])
        return self._block.weights[:, None] * rows

    def stiffen(self, moduli):
        return moduli.with_whole(self._block.at, self._roots)

    def aim(self, products):
        return quotient(self.scaling.point, products)

    def bear(self, aim, change):
        self._put(self._answer(self._asked(aim)), change)

    def follow(self, aim, rates, change):
        more = self._rates(rates)
        dy = self._answer(self._asked(aim) + more)
        self._put(dy, change)
        static = np.einsum("nkij,nj->nki", self._G, dy).reshape(aim.shape)
        kinematic = self.scaling.invert(aim - self.scaling.invert(static))
        left = self._works(kinematic) + self._off + more  # the first cone takes the rounding error
        kinematic[::2, 0] += left[:, 0] / self._block.slopes[0]
        kinematic[::2, 1:] -= left[:, 1:]
        return Members(static, kinematic)

    def resist(self, rates, change):
        self._put(self._answer(self._rates(rates)), change)
        return NO_OWN

    def _asked(self, aim):
        numbers = aim.reshape(len(self._G), -1)
        return self._off + np.einsum("nij,ni->nj", self._columns, numbers)

    def _answer(self, right):
        half = np.einsum("nji,nj->ni", self._roots, right)
        return np.einsum("nij,nj->ni", self._roots, half)

    def _put(self, dy, change):
        at = self._block.at
        change.pressure[at], change.deviator[at, : self._block.m] = dy[:, 0], dy[:, 1:]


@dataclass(frozen=True)
class CutSet(DruckerPragerSet):
    """The yield set."""

    tension: Expr

    def cones(self, size):
        slope, strength = (
            math.sqrt(2) * float(numbers_of(it)) for it in (self.slope, self.strength)
        )
        cut = float(numbers_of(self.tension))
        return (TwoCones((strength, 2 * slope * cut), (slope, 2 * slope)),)


@dataclass(frozen=True)
class CutLaw(DruckerPragerLaw):
    """The law; it has no use for levels."""

    tension: Expr

    @property
    def yields(self):
        return CutSet(self.slope, self.strength, self.tension)


@dataclass(frozen=True)
class CutGround(DruckerPrager):
    """Ground whose cone a second cone cuts off.

    Args:
        young: Young's modulus (stress).
        poisson: Poisson's ratio.
        cohesion: Mohr–Coulomb cohesion (stress).
        friction_angle: Mohr–Coulomb friction angle (degrees).
        match: Match of the Drucker–Prager cone.
        tension: Largest mean stress (stress), below that of the first cone.
    """

    law: ClassVar[type[CutLaw]] = CutLaw

    tension: float = 1.0

    def parameters(self):
        return super().parameters() | {"tension": self.tension}


MATERIALS["two-cones"] = CutGround
