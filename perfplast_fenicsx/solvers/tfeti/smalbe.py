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

PENALTY = 1.1
"""ρ in shares of ‖A‖."""

FIRST_BALANCE, SHRINK = 10.0, 0.1
"""M at first, in shares of ‖A‖, and its factor where the Lagrangian has not grown enough."""

LOOSE = 0.1
"""η: largest projected gradient that ends an inner iteration, relative to the first one."""


@dataclass(frozen=True)
class DualProgram:
    """What is minimised.

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


@dataclass(frozen=True)
class DualSolution:
    """The end of the iteration.

    Attributes:
        x: Within the bounds, exactly.
        multiplier: μ, in the range of Q.
        projected: Norm of the projected gradient that is left.
        off: ‖Qx‖ that is left.
        products: Products with A.
        rounds: Of the augmented Lagrangian.
        solved: Whether both are as small as was asked.
    """

    x: Floats
    multiplier: Floats
    projected: float
    off: float
    products: int
    rounds: int
    solved: bool


def solve_dual(
    program: DualProgram, start: Floats, gradient_tolerance: float, tolerance: float, most: int
) -> DualSolution:
    """Minimise. Collective.

    Args:
        program: What.
        start: To begin with; what is below bounds is put there.
        gradient_tolerance: Of the projected gradient.
        tolerance: Of ‖Qx‖.
        most: Products with A, behind which the iteration is given up.
    """
    P, rho = program.project, PENALTY * program.norm
    balance = FIRST_BALANCE * program.norm

    def hessian(x: Floats) -> Floats:
        inside = P(x)
        return program.multiply(inside) + rho * (x - inside)

    def precondition(g: Floats) -> Floats:
        inside = P(g)
        return P(program.precondition(inside)) + (g - inside) / rho

    x = np.maximum(start, program.lower)
    multiplier = np.zeros_like(x)
    inner = BoundProgram(
        hessian=hessian,
        precondition=precondition,
        comm=program.comm,
        lower=program.lower,
        norm=max(program.norm, rho),
        x=x,
        gradient=hessian(x) - program.b,
        products=1,
    )
    first = inner.dot(inner.gradient, inner.gradient) ** 0.5
    last = -np.inf
    rounds = 0
    while True:
        rounds += 1
        seen: dict[str, float] = {}

        def enough(x: Floats, projected: float) -> bool:
            off = program.length(x - P(x))
            seen["projected"], seen["off"] = projected, off
            if projected <= gradient_tolerance and off <= tolerance:
                return True
            wanted = min(balance * off, LOOSE * first)
            return projected <= max(wanted, 0.5 * gradient_tolerance)

        going = minimise(inner, enough, most)
        done = seen["projected"] <= gradient_tolerance and seen["off"] <= tolerance
        if done or not going:
            return DualSolution(
                inner.x, multiplier, seen["projected"], seen["off"], inner.products, rounds, done
            )
        off = inner.x - P(inner.x)
        lagrangian = _lagrangian(inner, program.b, multiplier)
        if lagrangian < last + rho / 2 * seen["off"] ** 2:
            balance *= SHRINK
        last = lagrangian
        multiplier = multiplier + rho * off
        inner.gradient = inner.gradient + rho * off


def _lagrangian(inner: BoundProgram, b: Floats, multiplier: Floats) -> float:
    """½ xᵀHx − (b − μ)ᵀx at x, where g = Hx − b + μ. Collective."""
    return 0.5 * inner.dot(inner.gradient - b + multiplier, inner.x)
