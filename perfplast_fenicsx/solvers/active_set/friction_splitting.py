"""Split friction: a separate slip q follows the jumps s of u, as strains do in ALG2.

With the multiplier μ of s = q, and the penalty r k of a place with the stiffness k:

1. u minimises the energy with ½ r k ‖s − q + μ/(r k)‖² added,
2.  q = shrink(s + μ/(r k)) by c/(r k),
3. μ ← μ + r k (s − q), which lies in the ball ‖μ‖ ≤ c.

No place is held or released, so that the method converges to the solution, if slowly, however many
places are undecided. It is the friction method of ALG2, and the fallback of Newton's methods when
they cycle.
"""

from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.contact.rows.friction import norms, shrunk
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.solvers.active_set.slip import Slip, judge, stuck
from perfplast_fenicsx.solvers.linear.contact_operator import ContactOperator


class FrictionSplitting:
    """q and μ at the places of friction hosted by this rank."""

    def __init__(self, problem: Problem, operator: ContactOperator, stiffness: Floats) -> None:
        """Add the springs to an operator. Collective.

        Args:
            problem: Problem with the places.
            operator: Operator of the bodies, without the springs.
            stiffness: Stiffness k, shape (num_places,).
        """
        self._problem, self._k, friction = problem, stiffness, problem.friction
        each = self._k[:, None, None] * np.eye(friction.index.shape[1])
        operator.add_springs((friction.index, each))
        self._q, self._mu = np.zeros(friction.index.shape), np.zeros(friction.index.shape)

    def begin(self, jumps: Floats) -> None:
        """Start from a slip and its forces."""
        sizes, bound = norms(jumps), self._problem.friction.bound
        self._q = jumps.copy()
        slips = (sizes > 0) & np.isfinite(bound)
        share = np.divide(bound, sizes, out=np.zeros_like(sizes), where=slips)
        self._mu = share[:, None] * jumps

    def slip(self) -> Slip:
        """Return the linearisation at the present values; the last trial μ + r k s has r = 1."""
        z = self._mu + self._k[:, None] * self._q
        nothing = stuck(z.shape)
        return judge(nothing, self._problem.friction.bound, self._k, z, np.zeros_like(z))

    def add_gradient(self, jumps: Floats, r: float, gradient: PETSc.Vec) -> None:
        """Add (μ + r k (s − q))/r to a gradient in jump unknowns."""
        force = self._mu / r + self._k[:, None] * (jumps - self._q)
        self._problem.friction.add(force, gradient.array)

    def follow(self, jumps: Floats, r: float) -> Floats:
        """Do steps 2 and 3, and return the squared residuals. Collective.

        Returns:
            Squares of the primal and the dual residual, Σ k‖s − q‖² and Σ k‖Δq‖².
        """
        stiffness, before = r * self._k[:, None], self._q
        trial = self._mu + stiffness * jumps
        self._mu = shrunk(trial, self._problem.friction.bound)
        self._q = (trial - self._mu) / stiffness
        squares = [self._k @ norms(v) ** 2 for v in (jumps - self._q, self._q - before)]
        return np.asarray(self._problem.comm.allreduce(np.array(squares)), dtype=np.float64)
