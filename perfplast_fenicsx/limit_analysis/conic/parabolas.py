"""Bound in-plane stresses by a parabola, the criterion of Hoek and Brown, as two cones.

The in-plane stress has the mean p, ‖s‖ = √2 R and σ₁ = p + R. The set is R² ≤ k (f − σ₁). A stress
is in the set if a number t ≥ R exists with (2t + k)² ≤ 4k (P − p), where P = f + k/4. Each point
therefore has two second-order cone members,

    (√2 t, s)   and   (P − p + k, P − p − k, 2t + k),

which are linear in y = (t, p, s): x = h + Gy. The multipliers z of both members satisfy −Gᵀz = w
(0, tr ε, dev ε). With the scaling W of Nesterov and Todd and H = GᵀW⁻²G, the stress changes by dy =
H⁻¹(GᵀW⁻¹r + Gᵀz + w(ε + dε)) if the products change by W z ∘ r.

With v = tr ε > 0 and g = ε₁ − ε₃, a strain rate dissipates fv + (k/4) (g − v)₊²/v. All these sets
have the shape of one parabola; k determines the size, and the tensile strength f the position.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.limit_analysis.conic.cone import (
    MOST_VISCOUS,
    Borne,
    Columns,
    ConeKind,
    ConeRows,
    Members,
    Moduli,
    Rates,
)
from perfplast_fenicsx.limit_analysis.conic.second_order_cones import (
    ScaledMembers,
    Scaling,
    SecondOrderMembers,
    determinant,
    quotient,
)

ROOT2 = math.sqrt(2.0)

GENTLEST = 0.01
"""Least tr ε of a strict mechanism, relative to ε₁ − ε₃; the proof checker uses the same value. The
tangent of the parabola has this sine of the friction angle at stresses of about 2500 k, which
exceed all stresses of interest."""


@dataclass(frozen=True)
class Parabola:
    """The set R² ≤ k (f − σ₁) of in-plane stresses; see :class:`cone.LawSet`.

    Attributes:
        curvature: Size k > 0 (stress).
        tension: Tensile strength f > 0 (stress).
    """

    curvature: float
    tension: float

    def __post_init__(self) -> None:
        if not (0 < self.curvature < np.inf and 0 < self.tension < np.inf):
            raise InputError(
                f"the parabola with curvature = {self.curvature:.6g} and tension = "
                f"{self.tension:.6g} does not permit zero stress; give positive, finite numbers."
            )

    @property
    def apex(self) -> float:
        """Return P (stress), the largest p on the full parabola, on which R may be negative."""
        return self.tension + self.curvature / 4

    def around(self, flat: bool) -> tuple[float, float]:
        """Return γ and α of the tangent cone with a friction angle of 30°, at p = P − k.

        Raises:
            InputError: If the stresses are not in-plane stresses.
        """
        if not flat:
            raise InputError(
                "law = 'hoek-brown' needs plane strain, because its cones bound in-plane stresses; "
                "in 3D and in axisymmetry give law = 'mohr-coulomb'."
            )
        return self.apex / ROOT2, 1 / ROOT2

    def at_points(self, at: Longs, tensors: Floats, flat: bool) -> "Parabolas":
        """See :meth:`cone.LawSet.at_points`."""
        return Parabolas(self, at)

    def on_file(self) -> dict[str, float]:
        """See :meth:`cone.Provable.on_file`."""
        return {"cone_bound": self.tension, "cone_curvature": self.curvature}


@dataclass(frozen=True, eq=False)
class Parabolas:
    """The parabola at points; see :class:`cone.PointSets`.

    Attributes:
        of: The set.
        at: Indices of the points, shape (num,).
    """

    of: Parabola
    at: Longs

    @property
    def caps(self) -> Floats:
        """See :meth:`cone.PointSets.caps`."""
        return np.full(len(self.at), self.of.tension)

    def those(self, chosen: npt.NDArray[np.bool_] | Longs) -> "Parabolas":
        """See :meth:`cone.PointSets.those`."""
        return replace(self, at=self.at[chosen])

    def ratios(self, pressure: Floats, deviator: Floats) -> Floats:
        """Return the positive root g of kfg² − kσ₁g − R² = 0; see :meth:`cone.PointSets.ratios`."""
        k, f = self.of.curvature, self.of.tension
        radius = np.linalg.norm(deviator[self.at, :2], axis=1) / ROOT2
        along = k * (pressure[self.at] + radius)
        root = np.sqrt(along**2 + 4 * k * f * radius**2)
        pressed = 2 * radius**2 / np.where(along < 0, root - along, 1.0)  # without cancellation
        found: Floats = np.where(along < 0, pressed, (along + root) / (2 * k * f))
        return found

    def powers(self, trace: Floats, deviator: Floats) -> Floats:
        """See :meth:`cone.PointSets.powers`; tr ε counts as at least ``GENTLEST`` (ε₁ − ε₃)."""
        growth, shear = self._sizes(trace, deviator)
        growth = np.maximum(growth, GENTLEST * shear)
        over = np.maximum(shear - growth, 0.0)
        bent = np.divide(over**2, growth, out=np.zeros_like(over), where=over > 0)
        found: Floats = self.of.tension * growth + self.of.curvature / 4 * bent
        return found

    def lacking(self, trace: Floats, deviator: Floats) -> Floats:
        """See :meth:`cone.PointSets.lacking`."""
        growth, shear = self._sizes(trace, deviator)
        found: Floats = np.maximum(GENTLEST * shear - growth, 0.0)
        return found

    def _sizes(self, trace: Floats, deviator: Floats) -> tuple[Floats, Floats]:
        """Return tr ε and ε₁ − ε₃ of these points, shape (num,) each."""
        return trace[self.at], ROOT2 * np.linalg.norm(deviator[self.at, :2], axis=1)

    def block(self, unit: float, weights: Floats) -> "ParabolaPoints":
        """See :meth:`cone.PointSets.block`."""
        scaled = Parabola(self.of.curvature / unit, self.of.tension / unit)
        return ParabolaPoints(self.at, scaled, weights)


class ParabolaPoints(SecondOrderMembers):
    """Points with two cones each; see :class:`cone.Block`. Members have shape (2 num, 3)."""

    def __init__(self, at: Longs, of: Parabola, weights: Floats) -> None:
        """Store the points; compute h, G and the members at the centre of the set.

        Args:
            at: Indices of the points.
            of: The set of the points, in the unit of the program.
            weights: Weights w, shape (num,).
        """
        self.at, self.weights = at, weights
        k, apex = of.curvature, of.apex
        self._h: Floats = np.array([[0.0, 0.0, 0.0], [apex + k, apex - k, k]])
        self.G: Floats = np.zeros((2, 3, 4))
        self.G[0] = np.array([[ROOT2, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
        self.G[1] = np.array([[0, -1, 0, 0], [0, -1, 0, 0], [2, 0, 0, 0]])
        self._centre: Floats = np.array([k / 4, apex - k, 0.0, 0.0])  # t is half of its bound
        self._static: Floats = self._h + self.G @ self._centre
        inverse = self._static * [1.0, -1.0, -1.0] / determinant(self._static)[:, None]
        self._kinematic: Floats = inverse * max(1.0, (of.apex**2 / 2) / MOST_VISCOUS)

    @property
    def degree(self) -> int:
        """Return the number of cones, two for each point."""
        return 2 * len(self.at)

    def start(self, borne: Borne) -> Members:
        """See :meth:`cone.Block.start`."""
        count = len(self.at)
        borne.pressure[self.at] = self._centre[1]
        static, kinematic = (np.tile(it, (count, 1)) for it in (self._static, self._kinematic))
        return Members(static, kinematic, np.full(count, self._centre[0]))

    def flow(self, moduli: Moduli) -> None:
        """See :meth:`cone.Block.flow`."""
        scaling = Scaling(self._static, self._kinematic)
        columns = np.concatenate([scaling.invert(self.G[..., j])[None] for j in range(4)])
        inverse = np.linalg.inv(np.einsum("ikl,jkl->ij", columns, columns))
        moduli.bulk[self.at], moduli.a[self.at] = inverse[1, 1], inverse[2, 2]

    def static(self, borne: Borne, own: Floats) -> Floats:
        """See :meth:`cone.Block.static`."""
        y = np.column_stack([own, borne.pressure[self.at], borne.deviator[self.at, :2]])
        found: Floats = (self._h + np.einsum("kij,nj->nki", self.G, y)).reshape(-1, 3)
        return found

    def scaled(self, now: Members, rates: Rates) -> "ScaledParabolaPoints":
        """Return these points at an iterate, with the scaling of their cones."""
        return ScaledParabolaPoints(self, now, rates)

    def rows(self, at: Columns) -> ConeRows:
        """See :meth:`cone.MatrixBlock.rows`."""
        count = len(self.at)
        columns = np.column_stack([at.own, at.pressure[self.at], at.deviator[self.at, :2]])
        factors = np.tile(self.G, (count, 1, 1))
        right = np.tile(self._h, (count, 1))
        return ConeRows(ConeKind.SECOND_ORDER, right, np.repeat(columns, 2, axis=0), factors)

    def from_rows(self, static: Floats, kinematic: Floats, own: Floats) -> Members:
        """See :meth:`cone.MatrixBlock.from_rows`."""
        return Members(static, kinematic, own)


class ScaledParabolaPoints(ScaledMembers):
    """Points with parabolas at an iterate, with their scaling; see :class:`cone.ScaledBlock`."""

    def __init__(self, block: ParabolaPoints, now: Members, rates: Rates) -> None:
        """Compute the scaling, and factorise H of each point."""
        super().__init__(now)
        self._block = block
        count = len(block.at)
        rows = [np.tile(block.G[..., j], (count, 1)) for j in range(4)]
        columns = np.stack([self.scaling.invert(it) for it in rows], axis=2)
        self._columns: Floats = columns.reshape(count, 6, 4)
        self._roots: Floats = np.linalg.inv(np.linalg.qr(self._columns, mode="r"))
        self._off = self._works(now.kinematic) + self._rates(rates)

    def _works(self, kinematic: Floats) -> Floats:
        """Return Gᵀz, shape (num, 4)."""
        found: Floats = np.einsum("kij,nki->nj", self._block.G, kinematic.reshape(-1, 2, 3))
        return found

    def _rates(self, rates: Rates) -> Floats:
        """Return w (0, tr ε, dev ε), shape (num, 4)."""
        at = self._block.at
        rows = np.column_stack([np.zeros(len(at)), rates.trace[at], rates.deviator[at, :2]])
        found: Floats = self._block.weights[:, None] * rows
        return found

    def stiffen(self, moduli: Moduli) -> Moduli:
        """See :meth:`cone.ScaledBlock.stiffen`; H⁻¹ without the row and column of t is RRᵀ."""
        more = moduli.normal.shape[1] - 2
        roots = np.pad(self._roots[:, 1:, 1:], ((0, 0), (0, more), (0, more)))
        return moduli.with_whole(self._block.at, roots)

    def aim(self, products: Floats) -> Any:
        """See :meth:`cone.ScaledBlock.aim`."""
        return quotient(self.scaling.point, products)

    def bear(self, aim: Any, change: Borne) -> None:
        """See :meth:`cone.ScaledBlock.bear`."""
        self._put(self._answer(self._asked(aim)), change)

    def follow(self, aim: Any, rates: Rates, change: Borne) -> Members:
        """See :meth:`cone.ScaledBlock.follow`."""
        more = self._rates(rates)
        dy = self._answer(self._asked(aim) + more)
        self._put(dy, change)
        static = np.einsum("kij,nj->nki", self._block.G, dy).reshape(-1, 3)
        kinematic = self.scaling.invert(aim - self.scaling.invert(static))
        left = self._works(kinematic) + self._off + more  # more than rounding if not admissible
        kinematic[::2, 1:] -= left[:, 2:]
        kinematic[1::2, 2] -= left[:, 0] / 2
        kinematic[1::2, 0] += left[:, 1]
        return Members(static, kinematic, dy[:, 0])

    def resist(self, rates: Rates, change: Borne) -> Floats:
        """See :meth:`cone.ScaledBlock.resist`."""
        dy = self._answer(self._rates(rates))
        self._put(dy, change)
        own: Floats = dy[:, 0]
        return own

    def _asked(self, aim: Floats) -> Floats:
        found: Floats = self._off + np.einsum("nij,ni->nj", self._columns, aim.reshape(-1, 6))
        return found

    def _answer(self, right: Floats) -> Floats:
        """Return H⁻¹ times the vectors ``right``, shape (num, 4)."""
        half = np.einsum("nji,nj->ni", self._roots, right)
        found: Floats = np.einsum("nij,nj->ni", self._roots, half)
        return found

    def _put(self, dy: Floats, change: Borne) -> None:
        change.pressure[self._block.at] = dy[:, 1]
        change.deviator[self._block.at, :2] = dy[:, 2:]
