"""Directions of the interior point iteration for Melan's programme; see :mod:`corner_cones`.

With the scaling of Nesterov and Todd the cones of a point add up to one matrix H = Σ GᵀW_k⁻²G, so
that residual stresses change by H⁻¹ times a strain, and one factorisation is enough for a step, as
in limit analysis. Stresses that no cone bounds follow the proximal point method.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields

from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.conic.cone import PROXIMAL
from perfplast_fenicsx.limit_analysis.conic.conic_program import SOFTEST
from perfplast_fenicsx.limit_analysis.conic.second_order_cones import Scaling, quotient
from perfplast_fenicsx.limit_analysis.shakedown.corner_cones import CornerCones
from perfplast_fenicsx.limit_analysis.shakedown.point_operator import PointOperator


@dataclass(frozen=True)
class Here:
    """Where the iteration is, and what is left of its equations there.

    Attributes:
        residual: ρ, shape (count, m).
        members: s_k, shape (num, num_corners, 1 + k).
        multipliers: z_k, the same.
        off: −w ε(v) − Σ Gᵀz_k, shape (count, m).
        missing: −1 − Σ Gσ_k·z_k.
        outside: h + G(λσ_k + σ₀ + ρ) − s_k, as s_k.
    """

    residual: Floats
    members: Floats
    multipliers: Floats
    off: Floats
    missing: float
    outside: Floats


@dataclass(frozen=True)
class Change:
    """Changes of the unknowns on this rank; see :class:`MelanIteration`."""

    load: float
    residual: Floats
    members: Floats
    multipliers: Floats
    velocity: Floats

    def plus(self, other: "Change") -> "Change":
        """Return the sum."""
        return Change(*(getattr(self, it.name) + getattr(other, it.name) for it in fields(self)))


class MelanDirections:
    """Directions for given changes of the products of the cones.

    Attributes:
        scaling: Scaling of all cones, point by point.
    """

    def __init__(
        self, now: Here, cones: CornerCones, operator: PointOperator, vectors: Sequence[PETSc.Vec]
    ) -> None:
        """Assemble and factorise K. Collective.

        Args:
            now: The current iterate.
            cones: The programme.
            operator: Strains, forces and K.
            vectors: Four to work with.
        """
        self._now, self._cones, self._operator = now, cones, operator
        self._force, self._right, self._change, self._of_load = vectors
        self._shape = now.members.shape
        self.scaling = Scaling(self.flat(now.members), self.flat(now.multipliers))
        stiff = self._squared(np.broadcast_to(cones.live, self._shape))
        self._slopes = cones.at_points(cones.flows(stiff).sum(axis=1))
        self._curvature = cones.total(float((stiff * cones.live).sum()))
        operator.assemble(cones.weights[:, None, None] * self._inverses())
        operator.forces(self._inverted(self._slopes), self._force)
        operator.solve(self._force, self._of_load)
        self._strains = cones.weights[:, None] * operator.strains(self._of_load)

    def flat(self, members: Floats) -> Floats:
        """Return members of cones as rows."""
        return members.reshape(-1, self._shape[2])

    def _squared(self, members: Floats) -> Floats:
        """W⁻² of members."""
        twice = self.scaling.invert(self.scaling.invert(self.flat(members)))
        return twice.reshape(self._shape)

    def _inverses(self) -> Floats:
        """Moduli H⁻¹ at the points, and proximal ones of what no cone bounds, shape (count, m, m).

        Directions that corners bound on both sides are far stiffer than others: by eigenvectors
        both are right, and in one matrix with the others, or by elimination, they are rounding.
        """
        laws = self._cones.laws
        scale, normals = self.scaling.inverse_square()
        scale, normals = scale.reshape(self._shape[:2]), normals.reshape(self._shape)
        G, bounded = laws.maps, laws.bounded
        G = np.einsum("nij,njr->nir", G, bounded)
        along = np.einsum("nir,nki->nkr", G, normals) * np.sqrt(2 * scale)[:, :, None]
        signed = G.copy()
        signed[:, 0] *= -1.0
        H = np.swapaxes(along, 1, 2) @ along
        H += scale.sum(axis=1)[:, None, None] * (np.swapaxes(signed, 1, 2) @ G)
        values, vectors = np.linalg.eigh(H)
        stiff, axes = np.asarray(values, np.float64), np.asarray(vectors, np.float64)
        self._soft: Floats = np.asarray(1 / np.maximum(stiff, SOFTEST), np.float64)
        self._axes, self._mapped = bounded @ axes, G @ axes
        free = laws.unbounded
        found: Floats = np.einsum("nir,njr->nij", free, free) / PROXIMAL
        found[laws.plastic] += np.einsum("nir,nr,njr->nij", self._axes, self._soft, self._axes)
        return found

    def _along(self, strains: Floats) -> Floats:
        """Return the changes in bounded directions at the points that can yield, shape (num, r)."""
        x = strains[self._cones.laws.plastic]
        found: Floats = self._soft * np.einsum("nij,ni->nj", self._axes, x)
        return found

    def _power(self, along: Floats) -> float:
        """Σ c·δρ of this rank, of changes along the bounded directions, shape (num, r)."""
        slopes = self._slopes[self._cones.laws.plastic]
        return float((np.einsum("nij,ni->nj", self._axes, slopes) * along).sum())

    def _inverted(self, strains: Floats) -> Floats:
        """Return stresses of strains, shape (count, m)."""
        laws = self._cones.laws
        free = np.einsum("nij,ni->nj", laws.unbounded, strains) / PROXIMAL
        found: Floats = np.einsum("nij,nj->ni", laws.unbounded, free)
        found[laws.plastic] += np.einsum("nij,nj->ni", self._axes, self._along(strains))
        return found

    def towards(self, change: Floats) -> Change:
        """Return the direction in which the products change so, to first order. Collective.

        Once corrected by what its equations leave over, which is more than rounding where corners
        bound a point on both sides.

        Args:
            change: Shape (number of cones, 1 + k).
        """
        aim = self.scaling.invert(quotient(self.scaling.point, change)).reshape(self._shape)
        none, now, cones = np.zeros_like(aim), self._now, self._cones
        found = self._solve(aim, now.outside, now.off, now.residual, now.missing)
        flows = cones.at_points(cones.flows(found.multipliers).sum(axis=1))
        off = now.off - flows - cones.weights[:, None] * self._strains_of(found.velocity)
        work = cones.total(float((found.multipliers * cones.live).sum()))
        left = now.residual + found.residual
        return found.plus(self._solve(none, none, off, left, now.missing - work))

    def _strains_of(self, velocity: Floats) -> Floats:
        self._change.array[:] = velocity
        return self._operator.strains(self._change)

    def _solve(
        self, aim: Floats, outside: Floats, off: Floats, residual: Floats, missing: float
    ) -> Change:
        """Return the direction for given right-hand sides. Collective.

        Args:
            aim: What W⁻²δs + δz is to be.
            outside: What δs − G(δρ + δλ σ_k) is to be.
            off: What w ε(δv) + Σ Gᵀδz is to be.
            residual: The stress whose forces δρ is to balance.
            missing: What Σ Gσ_k·δz is to be.
        """
        cones, operator, slopes = self._cones, self._operator, self._slopes
        weights = cones.weights[:, None]
        pull = aim - self._squared(outside)
        push = cones.at_points(cones.flows(pull).sum(axis=1)) - off
        operator.forces(residual + self._inverted(push), self._right)
        self._right.scale(-1.0)
        operator.solve(self._right, self._change)
        strains = weights * operator.strains(self._change)
        steep = self._power(self._along(self._strains - slopes))
        known = (pull * cones.live).sum() - self._power(self._along(strains + push))
        sums = cones.comm.allreduce(np.array([steep, known]))
        load = float((sums[1] - missing) / (self._curvature + sums[0]))
        self._change.axpy(load, self._of_load)
        total = strains + load * self._strains + push - load * slopes
        mapped = np.einsum("nij,nj->ni", self._mapped, self._along(total))
        members = outside + load * cones.live + mapped[:, None]
        multipliers = aim - self._squared(members)
        velocity = self._change.array_r.copy()
        return Change(load, self._inverted(total), members, multipliers, velocity)
