"""SMALBE-M: quadratic programs with bounds and equalities, by augmented Lagrangians.

Semimonotonic augmented Lagrangians (Z. Dostál, Optimal Quadratic Programming Algorithms, Springer
2009, chapter 6), for

    minimise ½ xᵀAx − bᵀx  where  x ≥ lower  and  x is in the kernel of Q,

Q an orthogonal projector: A is to be PAP with P = I − Q. The bound-constrained programs of

    ½ xᵀ(A + ρQ)x − (b − Qμ)ᵀx

are solved by MPRGP until the projected gradient is at most M‖Qx‖, then μ grows by ρQx. ρ stays as
it is; where the Lagrangian has not grown enough, M shrinks.
"""

from dataclasses import dataclass

from mpi4py import MPI

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.solvers.tfeti.mprgp import BoundProgram, Operator, minimise

FIRST_BALANCE, SHRINK = 10.0, 0.1
"""M at first, in shares of ‖A‖, and its factor where the Lagrangian has not grown enough."""


@dataclass(frozen=True)
class DualProgram:
    """The program that is minimised.

    Attributes:
        comm: Ranks that share the unknowns.
        multiply: x ↦ Ax for x in the kernel of Q, with a result in it.
        project: P.
        precondition: Approximates A⁻¹; symmetric positive definite on the kernel.
        norm: ‖A‖, or an estimate.
        b: In the kernel of Q, shape (n,).
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
        """‖x‖. Collective."""
        return float(np.sqrt(self.comm.allreduce(float(x @ x))))


class Smalbe:
    """The iteration for one program, which may go on to smaller tolerances.

    Attributes:
        multiplier: μ, in the range of Q.
        projected: Norm of the projected gradient that is left.
        off: ‖Qx‖ that is left.
        rounds: Rounds of the augmented Lagrangian.
    """

    def __init__(self, program: DualProgram, start: Floats) -> None:
        """Begin. Collective.

        Args:
            program: What is minimised.
            start: To begin with; what is below bounds is put there.
        """
        self._program = program
        penalty = 1.1  # ρ in shares of ‖A‖
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
        """Within the bounds, exactly."""
        return self._inner.x

    @property
    def products(self) -> int:
        """Products with A so far."""
        return self._inner.products

    def run(self, jumps: float, forces: float, most: int) -> bool:
        """Go on. Collective.

        Args:
            jumps: Tolerance of the projected gradient.
            forces: Of ‖Qx‖.
            most: Products with A in all, after which the iteration is given up.

        Returns:
            Whether both are met; not where nothing is feasible.
        """
        program, inner = self._program, self._inner

        # η: largest projected gradient that ends an inner iteration, relative to the first one.
        loose = 0.1
        under = 0.5  # an inner iteration goes on to this share of the tolerance at most

        def enough(x: Floats, projected: float) -> bool:
            self.projected, self.off = projected, program.length(x - program.project(x))
            if projected <= jumps and self.off <= forces:
                return True
            wanted = min(self._balance * self.off, loose * self._first)
            return projected <= max(wanted, under * jumps)

        # Where so many rounds have not led to Qx = 0, nothing within
        # the bounds is in the kernel of Q.
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
        """½ xᵀHx − (b − μ)ᵀx at x, where g = Hx − b + μ. Collective."""
        inner = self._inner
        return 0.5 * inner.dot(inner.gradient - self._program.b + self.multiplier, inner.x)
