"""Friction in ALG2: a slip q of its own, which the jumps s of u follow as strains do.

With μ the multiplier of s = q and r k the penalty of a place with the stiffness k:

1.  u minimises with ½ r k ‖s − q + μ/(r k)‖² added,
2.  q = shrink(s + μ/(r k)) by c/(r k),
3.  μ ← μ + r k (s − q), which is in the ball ‖μ‖ ≤ c.

Nothing is held or released, so that it is independent of how Newton's methods find out what slips.
"""

from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.contact.friction import norms, shrunk
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.solvers.linear.contact_operator import ContactOperator


class FrictionSplitting:
    """q and μ of the places of friction hosted by this rank."""

    def __init__(self, problem: Problem, operator: ContactOperator) -> None:
        """Add the springs k to an elastic operator, as stiff as that is. Collective."""
        self._problem, friction = problem, problem.friction
        self._k: Floats = friction.gather(operator.diagonal()).max(axis=1)
        each = self._k[:, None, None] * np.eye(friction.index.shape[1])
        operator.add_springs((friction.index, each))
        self._q, self._mu = np.zeros(friction.index.shape), np.zeros(friction.index.shape)

    def begin(self, jumps: Floats) -> None:
        """Start from a slip, with the forces that go with it."""
        sizes = norms(jumps)
        self._q = jumps.copy()
        share = np.divide(self._problem.friction.bound, sizes, out=sizes.copy(), where=sizes > 0)
        self._mu = share[:, None] * jumps

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
