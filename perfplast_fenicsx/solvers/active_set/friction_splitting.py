"""Friction by splitting: a slip q of its own, which the jumps s of u follow, as strains do in ALG2.

With μ the multiplier of s = q and r k the penalty of a place with the stiffness k:

1.  u minimises with ½ r k ‖s − q + μ/(r k)‖² added,
2.  q = shrink(s + μ/(r k)) by c/(r k),
3.  μ ← μ + r k (s − q), which is in the ball ‖μ‖ ≤ c.

Nothing is held or released, so that it goes to the solution however many places are undecided, if
slowly. It is the friction of ALG2, and where Newton's methods go when they run in circles.
"""

from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.contact.rows.friction import norms, shrunk
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.solvers.active_set.slip import Slip, judge, stuck
from perfplast_fenicsx.solvers.linear.contact_operator import ContactOperator


class FrictionSplitting:
    """q and μ of the places of friction hosted by this rank."""

    def __init__(self, problem: Problem, operator: ContactOperator, stiffness: Floats) -> None:
        """Add the springs to an operator. Collective.

        Args:
            problem: Whose places they are at.
            operator: Operator of the bodies, as it stays.
            stiffness: k, shape (num_places,).
        """
        self._problem, self._k, friction = problem, stiffness, problem.friction
        each = self._k[:, None, None] * np.eye(friction.index.shape[1])
        operator.add_springs((friction.index, each))
        self._q, self._mu = np.zeros(friction.index.shape), np.zeros(friction.index.shape)

    def begin(self, jumps: Floats) -> None:
        """Start from a slip, with the forces that go with it."""
        sizes, bound = norms(jumps), self._problem.friction.bound
        self._q = jumps.copy()
        slips = (sizes > 0) & np.isfinite(bound)
        share = np.divide(bound, sizes, out=np.zeros_like(sizes), where=slips)
        self._mu = share[:, None] * jumps

    def slip(self) -> Slip:
        """Linearise where it has come to; the last trial μ + r k s has r = 1."""
        z = self._mu + self._k[:, None] * self._q
        nothing = stuck(z.shape)
        return judge(nothing, self._problem.friction.bound, self._k, z, np.zeros_like(z))

    def add_gradient(self, jumps: Floats, r: float, gradient: PETSc.Vec) -> None:
        """Add (μ + r k (s − q))/r to a gradient in jump unknowns."""
        force = self._mu / r + self._k[:, None] * (jumps - self._q)
        self._problem.friction.add(force, gradient.array)

    def follow(self, jumps: Floats, r: float) -> Floats:
        """Do steps 2 and 3. Collective.

        Returns:
            Squares of the primal and the dual residual, Σ k‖s − q‖² and Σ k‖Δq‖².
        """
        stiffness, before = r * self._k[:, None], self._q
        trial = self._mu + stiffness * jumps
        self._mu = shrunk(trial, self._problem.friction.bound)
        self._q = (trial - self._mu) / stiffness
        squares = [self._k @ norms(v) ** 2 for v in (jumps - self._q, self._q - before)]
        return np.asarray(self._problem.comm.allreduce(np.array(squares)), dtype=np.float64)
