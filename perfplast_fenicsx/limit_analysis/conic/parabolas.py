"""Bound in-plane stresses by a parabola, the criterion of Hoek and Brown, as two cones.

The in-plane stress has the mean p, ‖s‖ = √2 R and σ₁ = p + R. The set is R² ≤ k (f − σ₁). A stress
is in the set if a number t ≥ R exists with (2t + k)² ≤ 4k (P − p), where P = f + k/4. Each point
therefore has two second-order cone members,

    (√2 t, s)   and   (P − p + k, P − p − k, 2t + k),

which are linear in y = (t, p, s) (:class:`cone.SystemPoints`).

With v = tr ε > 0 and g = ε₁ − ε₃, a strain rate dissipates fv + (k/4) (g − v)₊²/v. All these sets
have the shape of one parabola; k determines the size, and the tensile strength f the position.
"""

import math
from dataclasses import dataclass, replace

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
    ScaledSystems,
    SystemPoints,
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


class ParabolaPoints(SystemPoints, SecondOrderMembers):
    """Points with two cones each; see :class:`cone.Block`. Members have shape (2 num, 3)."""

    def __init__(self, at: Longs, of: Parabola, weights: Floats) -> None:
        """Store the points; compute h, G and the members at the centre of the set.

        Args:
            at: Indices of the points.
            of: The set of the points, in the unit of the program.
            weights: Weights w, shape (num,).
        """
        self.at, self.weights, self.size = at, weights, 2
        k, apex = of.curvature, of.apex
        h: Floats = np.array([[0.0, 0.0, 0.0], [apex + k, apex - k, k]])
        self.constants = np.tile(h, (len(at), 1))
        self.G: Floats = np.zeros((2, 3, 4))
        self.G[0] = np.array([[ROOT2, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
        self.G[1] = np.array([[0, -1, 0, 0], [0, -1, 0, 0], [2, 0, 0, 0]])
        self._centre: Floats = np.array([k / 4, apex - k, 0.0, 0.0])  # t is half of its bound
        self._static: Floats = h + self.G @ self._centre
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

    def changes(self, y: Floats) -> Floats:
        """See :meth:`cone.SystemPoints.changes`."""
        found: Floats = np.einsum("kij,nj->nki", self.G, y).reshape(-1, 3)
        return found

    def works(self, kinematic: Floats) -> Floats:
        """See :meth:`cone.SystemPoints.works`."""
        found: Floats = np.einsum("kij,nki->nj", self.G, kinematic.reshape(-1, 2, 3))
        return found

    def least(self, works: Floats) -> Floats:
        """Return a z with two zeros at each point; see :meth:`cone.SystemPoints.least`."""
        found = np.zeros((2 * len(works), 3))
        found[::2, 1:] = works[:, 2:]
        found[1::2, 2] = works[:, 0] / 2
        found[1::2, 0] = -works[:, 1]
        return found

    def scaled(self, now: Members, rates: Rates) -> "ScaledParabolaPoints":
        """Return these points at an iterate, with the scaling of their cones."""
        return ScaledParabolaPoints(self, now, rates)

    def rows(self, at: Columns) -> ConeRows:
        """See :meth:`cone.MatrixBlock.rows`."""
        columns = np.repeat(self.chosen(at.own, at.pressure, at.deviator), 2, axis=0)
        factors = np.tile(self.G, (len(self.at), 1, 1))
        return ConeRows(ConeKind.SECOND_ORDER, self.constants, columns, factors)


class ScaledParabolaPoints(ScaledSystems, ScaledMembers):
    """Points with parabolas at an iterate, with their scaling; see :class:`cone.ScaledBlock`."""

    def __init__(self, block: ParabolaPoints, now: Members, rates: Rates) -> None:
        """Compute the scaling, and factorise H of each point."""
        scaling, count = Scaling(now.static, now.kinematic), len(block.at)
        rows = [np.tile(block.G[..., j], (count, 1)) for j in range(4)]
        columns = np.stack([scaling.invert(it) for it in rows], axis=2).reshape(count, 6, 4)
        super().__init__(block, scaling, columns, now, rates)

    def aim(self, products: Floats) -> tuple[Floats, Floats]:
        """See :class:`cone.ScaledSystems`."""
        aim = quotient(self.scaling.point, products)
        return aim, aim.reshape(-1, 6)
