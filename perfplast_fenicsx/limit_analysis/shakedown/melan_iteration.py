"""Primal-dual interior point iteration for Melan's programme; see :mod:`corner_cones`.

Steps are Mehrotra's, a predictor and a corrector with the factors of one matrix
(:mod:`melan_directions`).
"""

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.conic.second_order_cones import longest_step, product
from perfplast_fenicsx.limit_analysis.shakedown.corner_cones import CornerCones
from perfplast_fenicsx.limit_analysis.shakedown.melan_directions import (
    Change,
    Here,
    MelanDirections,
)
from perfplast_fenicsx.limit_analysis.shakedown.point_operator import PointOperator
from perfplast_fenicsx.rounding import TINY


class MelanIteration:
    """The iterate, and steps of it.

    Attributes:
        load: λ, in the programme's unit.
        residual: ρ, shape (count, m).
        members: s_k, shape (num, num_corners, 1 + k).
        multipliers: z_k, the same.
        velocity: v.
    """

    def __init__(self, cones: CornerCones, operator: PointOperator) -> None:
        """Start in the middle of the cones, at rest. Collective."""
        self.cones, self._operator = cones, operator
        self.load, self.residual = 0.0, np.zeros((operator.count, operator.size))
        self.members = np.zeros_like(cones.live)
        self.members[:, :, 0] = cones.heads
        self.multipliers = np.zeros_like(cones.live)
        self.multipliers[:, :, 0] = cones.weights[cones.laws.plastic, None]
        self.velocity: PETSc.Vec = operator.create_vector()
        self._vectors = [operator.create_vector() for _ in range(4)]

    def destroy(self) -> None:
        """Give PETSc's memory back. Collective."""
        for vector in (self.velocity, *self._vectors):
            vector.destroy()

    def gap(self) -> float:
        """By how much Koiter's value exceeds Melan's once all else is right. Collective."""
        return self.cones.total(float((self.members * self.multipliers).sum()))

    def unbalanced(self) -> float:
        """Largest force of the residual stress, relative to that of a stress of its size.

        Collective.
        """
        force = self._vectors[0]
        self._operator.forces(self.residual, force)
        sizes = np.linalg.norm(self.residual, axis=1).max(initial=0.0)
        largest = self.cones.comm.allreduce(float(sizes), MPI.MAX)
        unit = self._operator.force_unit * max(largest, 1.0)
        return float(force.norm(PETSc.NormType.NORM_INFINITY) / unit)

    def incompatible(self) -> float:
        """Return the incompatible part of the flow of a cycle, relative to all flow. Collective."""
        flows = self.cones.flows(self.multipliers)
        off = self._unmatched(flows)
        sums = [np.linalg.norm(off, axis=1).sum(), np.linalg.norm(flows, axis=2).sum()]
        wrong, whole = self.cones.comm.allreduce(np.array(sums))
        return float(wrong / max(whole, TINY))

    def missing_work(self) -> float:
        """|1 − Σ σ_k:p_k|. Collective."""
        return abs(1 + self._work())

    def _unmatched(self, flows: Floats) -> Floats:
        """W ε(v) − Σ p_k, shape (count, m). Collective."""
        strains = self._operator.strains(self.velocity)
        found: Floats = self.cones.weights[:, None] * strains
        return found + self.cones.at_points(flows.sum(axis=1))

    def step(self) -> float:
        """Make a step. Collective.

        Returns:
            The shorter of its lengths for stresses and for flow, at most 1.

        Raises:
            SingularStiffness: If K cannot be factorised.
        """
        newton = MelanDirections(self._at(), self.cones, self._operator, self._vectors)
        here = product(newton.scaling.point, newton.scaling.point)
        mu = self.gap() / self.cones.degree
        affine = newton.towards(-here)
        reach = self._longest(affine)
        left = self.cones.total(
            float(
                (
                    (self.members + reach[0] * affine.members)
                    * (self.multipliers + reach[1] * affine.multipliers)
                ).sum()
            )
        )
        centre = mu * min(1.0, max(left / (mu * self.cones.degree), 0.0)) ** 3
        scaling = newton.scaling
        second = product(
            scaling.invert(newton.flat(affine.members)),
            scaling.apply(newton.flat(affine.multipliers)),
        )
        aim = -here - second
        aim[:, 0] += centre
        chosen = newton.towards(aim)
        inside = 0.98  # share of the way to the edge of a cone
        stress, flow = (min(1.0, inside * length) for length in self._longest(chosen))
        self.load += stress * chosen.load
        self.residual += stress * chosen.residual
        self.members += stress * chosen.members
        self.multipliers += flow * chosen.multipliers
        self.velocity.array[:] += flow * chosen.velocity
        return min(stress, flow)

    def _at(self) -> Here:
        """Return the iterate and its residuals. Collective."""
        flows = self.cones.flows(self.multipliers)
        missing = -1.0 - self._work()
        outside = self.cones.members(self.load, self.residual) - self.members
        return Here(
            self.residual,
            self.members,
            self.multipliers,
            -self._unmatched(flows),
            missing,
            outside,
        )

    def _work(self) -> float:
        """Σ Gσ_k·z_k. Collective."""
        return self.cones.total(float((self.multipliers * self.cones.live).sum()))

    def _longest(self, change: Change) -> tuple[float, float]:
        rows = self.members.shape[2]
        pairs = ((self.members, change.members), (self.multipliers, change.multipliers))
        mine = [longest_step(a.reshape(-1, rows), b.reshape(-1, rows)) for a, b in pairs]
        stress, flow = (float(self.cones.comm.allreduce(t, MPI.MIN)) for t in mine)
        return min(1.0, stress), min(1.0, flow)
