"""Melan's programme at the points of a rank: a cone for each corner of the load domain at each.

With the elastic stresses σ_k of the corners, σ₀ of the constant loads and a residual stress ρ that
is in balance with nothing,

    max λ    with  s_k = h + G(λσ_k + σ₀ + ρ) in the cone of each point, for each corner.

The multipliers z_k, in the same cones, are the plastic flow p_k = −Gᵀz_k at each corner:

    min Σ z_k·(h + Gσ₀)    with  w ε(v) = Σ_k p_k,  Σ_k σ_k:p_k = 1,

which is Koiter's: the flow of a whole cycle is compatible with the increment v of displacement that
it leaves. Where plasticity alternates the flow of a cycle cancels out, and v is zero. In plane
strain ρ has the stress out of the plane as well, one for all corners.
"""

from dataclasses import dataclass

from mpi4py import MPI

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.shakedown.point_laws import PointLaws
from perfplast_fenicsx.rounding import TINY


@dataclass(frozen=True)
class CornerCones:
    """Data of the programme, stresses in units of the mean strength and weights with the mean 1.

    Attributes:
        comm: The ranks.
        laws: Cones and elasticity at the points.
        weights: w, shape (count,).
        heads: The first component of h, shape (num, 1).
        live: Gσ_k, shape (num, num_corners, 1 + k), in units in which λ is about the number of
            cones.
        dead: Gσ₀, shape (num, 1, 1 + k).
        degree: Number of cones of all ranks.
        stress_unit: Unit of stresses.
        load_unit: Unit of λ.
        weight_unit: Unit of weights.
    """

    comm: MPI.Intracomm
    laws: PointLaws
    weights: Floats
    heads: Floats
    live: Floats
    dead: Floats
    degree: int
    stress_unit: float
    load_unit: float
    weight_unit: float

    @staticmethod
    def of(
        comm: MPI.Intracomm, laws: PointLaws, weights: Floats, live: Floats, dead: Floats
    ) -> "CornerCones | None":
        """Choose units. Collective.

        Args:
            comm: The ranks.
            laws: At the points.
            weights: Volumes of the points, shape (count,).
            live: σ_k, shape (num_corners, count, m).
            dead: σ₀, shape (count, m).

        Returns:
            None where no point that can yield is stressed by what varies.
        """
        plastic, G = laws.plastic, laws.maps
        mine = [len(weights), weights.sum(), len(plastic), (1 / laws.bounds).sum()]
        points, volume, cones, weaknesses = comm.allreduce(np.array(mine))
        if not cones:
            return None
        unit, mean = cones / weaknesses, volume / points
        stressed = np.einsum("nij,knj->nki", G, live[:, plastic])
        sizes = np.linalg.norm(stressed, axis=2) / laws.bounds[:, None]
        worst = comm.allreduce(float(sizes.max(initial=0.0)), MPI.MAX)
        if not worst > 0:
            return None
        degree = int(cones) * len(live)
        load = 1 / (worst * degree)
        return CornerCones(
            comm=comm,
            laws=laws,
            weights=weights / mean,
            heads=laws.bounds[:, None] / unit,
            live=stressed * (load / unit),
            dead=np.einsum("nij,nj->ni", G, dead[plastic])[:, None] / unit,
            degree=degree,
            stress_unit=unit,
            load_unit=load,
            weight_unit=mean,
        )

    @property
    def corners(self) -> int:
        """How many there are."""
        return self.live.shape[1]

    def members(self, load: float, residual: Floats) -> Floats:
        """s_k, shape (num, num_corners, 1 + k).

        Args:
            load: λ.
            residual: ρ, shape (count, m).
        """
        found: Floats = load * self.live + self.dead + self.mapped(residual)[:, None]
        found[:, :, 0] += self.heads
        return found

    def mapped(self, stress: Floats) -> Floats:
        """Gσ at the points that can yield, shape (num, 1 + k)."""
        found: Floats = np.einsum("nij,nj->ni", self.laws.maps, stress[self.laws.plastic])
        return found

    def flows(self, members: Floats) -> Floats:
        """Gᵀz, shape (num, num_corners, m)."""
        found: Floats = np.einsum("nij,nki->nkj", self.laws.maps, members)
        return found

    def at_points(self, values: Floats) -> Floats:
        """Return vectors at the points that can yield, and zero at others, shape (count, m)."""
        found = np.zeros((len(self.weights), values.shape[-1]))
        found[self.laws.plastic] = values
        return found

    def ratio(self, load: float, residual: Floats) -> float:
        """By how much a stress of a corner exceeds yield at most. Collective."""
        s = self.members(load, residual)
        over = 1 + (np.linalg.norm(s[:, :, 1:], axis=2) - s[:, :, 0]) / self.heads
        return float(self.comm.allreduce(over.max(initial=0.0), MPI.MAX))

    def first_yield(self) -> float | None:
        """λ at which a stress without ρ yields first at a corner; None beside dead loads.

        Collective.
        """
        sizes = np.linalg.norm(self.live[:, :, 1:], axis=2) - self.live[:, :, 0]
        worst = (sizes / self.heads).max(initial=0.0)
        dead = float(np.abs(self.dead).max(initial=0.0))
        worst, dead = (self.comm.allreduce(float(it), MPI.MAX) for it in (worst, dead))
        return 1 / worst if not dead > 0 and worst > 0 else None

    def dissipation(self, members: Floats) -> Floats:
        """z·(h + Gσ₀) summed over the corners, shape (num,)."""
        power: Floats = (members[:, :, 0] * self.heads).sum(axis=1)
        return power + np.einsum("nki,nki->n", members, np.broadcast_to(self.dead, members.shape))

    def accumulated(self, members: Floats) -> float:
        """Share of the flow of a cycle that is left at its end, of all that flows. Collective.

        It is zero where plasticity alternates, and one where each point flows at one corner.
        """
        flows = self.flows(members)
        left = np.linalg.norm(flows.sum(axis=1), axis=1).sum()
        all_of_it = np.linalg.norm(flows, axis=2).sum()
        sums = self.comm.allreduce(np.array([left, all_of_it]))
        return float(sums[0] / max(sums[1], TINY))

    def total(self, value: float) -> float:
        """Sum over the ranks. Collective."""
        return float(self.comm.allreduce(value))
