"""Solve quadratic programs with bounds and equalities by SMALBE-M, an augmented Lagrangian.

Semimonotonic augmented Lagrangians (Z. Dostál, Optimal Quadratic Programming Algorithms, Springer
2009, chapter 6), for

    minimise ½ xᵀAx − bᵀx  where  x ≥ lower  and  x is in the kernel of Q,

with an orthogonal projector Q; A must be PAP with P = I − Q. The bound-constrained programs of

    ½ xᵀ(A + ρQ)x − (b − Qμ)ᵀx

are solved by MPRGP until the projected gradient is at most M‖Qx‖; then μ grows by ρQx. ρ is
constant; if the Lagrangian has not grown enough, M decreases.
"""

from dataclasses import dataclass

from mpi4py import MPI

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.solvers.tfeti.mprgp import BoundProgram, Operator, minimise

FIRST_BALANCE, SHRINK = 10.0, 0.1
"""Initial M relative to ‖A‖, and its factor if the Lagrangian has not grown enough."""


@dataclass(frozen=True)
class DualProgram:
    """The program to be minimised.

    Attributes:
        comm: Ranks that share the unknowns.
        multiply: Function x ↦ Ax for x in the kernel of Q, with a result in the kernel.
        project: The projector P.
        precondition: Function that approximates A⁻¹; symmetric positive definite on the kernel.
        norm: ‖A‖, or an estimate.
        b: Vector in the kernel of Q, shape (n,).
        lower: Bounds, −∞ for none, shape (n,).
    """

    comm: MPI.Intracomm
    multiply: Operator
    project: Operator
    precondition: Operator
    norm: float
    b: Floats
    lower: Floats

    def length(self, x: Floats) -> float:
        """Return ‖x‖. Collective."""
        return float(np.sqrt(self.comm.allreduce(float(x @ x))))


class Smalbe:
    """The iteration for one program, which may continue to smaller tolerances.

    Attributes:
        multiplier: Multiplier μ, in the range of Q.
        projected: Norm of the present projected gradient.
        off: The present ‖Qx‖.
        rounds: Number of augmented Lagrangian iterations.
    """

    def __init__(self, program: DualProgram, start: Floats) -> None:
        """Initialise the iteration. Collective.

        Args:
            program: The program to be minimised.
            start: Initial x; entries below bounds are moved to the bounds.
        """
        self._program = program
        penalty = 1.1  # ρ relative to ‖A‖
        self._rho = penalty * program.norm
        self._balance = FIRST_BALANCE * program.norm
        x = np.maximum(start, program.lower)
        self.multiplier = np.zeros_like(x)
        self._inner = BoundProgram(
            hessian=self._hessian,
            precondition=self._precondition,
            comm=program.comm,
            lower=program.lower,
            norm=max(program.norm, self._rho),
            x=x,
            gradient=self._hessian(x) - program.b,
            products=1,
        )
        self._first = program.length(self._inner.gradient)
        self._last = -np.inf
        self.rounds, self.projected, self.off = 0, np.inf, np.inf

    @property
    def x(self) -> Floats:
        """Return x, exactly within the bounds."""
        return self._inner.x

    @property
    def products(self) -> int:
        """Return the number of products with A so far."""
        return self._inner.products

    def run(self, jumps: float, forces: float, most: int) -> bool:
        """Iterate, and return whether both tolerances are met. Collective.

        Args:
            jumps: Tolerance of the projected gradient.
            forces: Tolerance of ‖Qx‖.
            most: Largest total number of products with A.

        Returns:
            Whether both are met; False if nothing is feasible.
        """
        program, inner = self._program, self._inner

        # η: largest projected gradient that ends an inner iteration, relative to the first one.
        loose = 0.1
        under = 0.5  # least share of the tolerance for inner iterations

        def enough(x: Floats, projected: float) -> bool:
            self.projected, self.off = projected, program.length(x - program.project(x))
            if projected <= jumps and self.off <= forces:
                return True
            wanted = min(self._balance * self.off, loose * self._first)
            return projected <= max(wanted, under * jumps)

        # If Qx does not vanish after this number of iterations, no point within the bounds lies in
        # the kernel of Q.
        most_rounds = 200
        while True:
            self.rounds += 1
            going = minimise(inner, enough, most)
            if self.projected <= jumps and self.off <= forces:
                return True
            if not going or self.rounds >= most_rounds:
                return False
            off = inner.x - program.project(inner.x)
            lagrangian = self._lagrangian()
            if lagrangian < self._last + self._rho / 2 * self.off**2:
                self._balance *= SHRINK
            self._last = lagrangian
            self.multiplier = self.multiplier + self._rho * off
            inner.gradient = inner.gradient + self._rho * off

    def _hessian(self, x: Floats) -> Floats:
        inside = self._program.project(x)
        return self._program.multiply(inside) + self._rho * (x - inside)

    def _precondition(self, g: Floats) -> Floats:
        P = self._program.project
        inside = P(g)
        return P(self._program.precondition(inside)) + (g - inside) / self._rho

    def _lagrangian(self) -> float:
        """Return ½ xᵀHx − (b − μ)ᵀx at x, where g = Hx − b + μ. Collective."""
        inner = self._inner
        return 0.5 * inner.dot(inner.gradient - self._program.b + self.multiplier, inner.x)
