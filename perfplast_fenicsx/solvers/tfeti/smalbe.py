"""Solve quadratic programs with bounds and equalities, by SMALBE-M and MPRGP.

SMALBE-M is the method of semimonotonic augmented Lagrangians (Z. Dostál, Optimal Quadratic
Programming Algorithms, Springer 2009, chapter 6). It solves

    minimise ½ xᵀAx − bᵀx  where  x ≥ lower  and  x is in the kernel of Q,

with an orthogonal projector Q; A must be PAP with P = I − Q. MPRGP solves the bound-constrained
programs of

    ½ xᵀ(A + ρQ)x − (b − Qμ)ᵀx

until the norm of the projected gradient is at most M‖Qx‖; then μ increases by ρQx. The penalty ρ is
constant; if the Lagrangian has not increased enough, M decreases.

MPRGP (modified proportioning with reduced gradient projections; Z. Dostál, Optimal Quadratic
Programming Algorithms, Springer 2009, chapter 5) solves quadratic programs with bounds by CG on
faces, expansion and proportioning:

    minimise ½ xᵀHx − bᵀx  where  x ≥ lower

The gradient g is split into its free part φ (zero at bounds) and the chopped part β (which leaves
bounds). CG steps in the free unknowns continue while ‖β‖² ≤ φ̃ᵀφ, where φ̃ is φ limited to a step
of length ᾱ. A step that reaches a bound stops at the bound, and a projected step along −φ follows.
"""

from collections.abc import Callable
from dataclasses import dataclass

from mpi4py import MPI

import numpy as np

from perfplast_fenicsx.arrays import Floats

Operator = Callable[[Floats], Floats]


@dataclass(frozen=True)
class Split:
    """The parts of a gradient at a feasible point.

    Attributes:
        free: The free gradient φ.
        chopped: The chopped gradient β.
        reduced: The reduced free gradient φ̃.
    """

    free: Floats
    chopped: Floats
    reduced: Floats

    @property
    def projected(self) -> Floats:
        """Return φ + β, which is zero at the solution."""
        return self.free + self.chopped


def split(gradient: Floats, x: Floats, lower: Floats, longest: float) -> Split:
    """Return the free, the chopped and the reduced part of a gradient.

    Args:
        gradient: Gradient at x.
        x: Feasible point.
        lower: Bounds; −∞ if there is no bound.
        longest: Step length ᾱ.
    """
    at_bound = x <= lower
    free = np.where(at_bound, 0.0, gradient)
    chopped = np.where(at_bound, np.minimum(gradient, 0.0), 0.0)
    reduced = np.where(at_bound, 0.0, np.minimum((x - lower) / longest, gradient))
    return Split(free, chopped, reduced)


@dataclass
class BoundProgram:
    """The program to be minimised, and the current iterate.

    Attributes:
        hessian: Function x ↦ Hx.
        precondition: Function that approximates H⁻¹ on all unknowns; it must be symmetric positive
            definite.
        comm: Communicator of the ranks that share the unknowns.
        lower: Bounds.
        norm: ‖H‖, an upper bound on it, or a close estimate.
        x: Feasible iterate.
        gradient: Gradient Hx − b.
        products: Number of products with H so far.
    """

    hessian: Operator
    precondition: Operator
    comm: MPI.Intracomm
    lower: Floats
    norm: float
    x: Floats
    gradient: Floats
    products: int = 0

    def dot(self, a: Floats, b: Floats) -> float:
        """Return aᵀb. Collective."""
        return self.comm.allreduce(float(a @ b))


def minimise(program: BoundProgram, enough: Callable[[Floats, float], bool], most: int) -> bool:
    """Iterate, and return whether the required accuracy is reached.

    The function changes ``x`` and ``gradient`` of the program.

    Collective.

    Args:
        program: The program to be minimised; its x may be any feasible point.
        enough: Function of x and the norm of the projected gradient that ends the iteration; the
            result must be the same on every rank.
        most: Largest total number of products with H.

    Returns:
        Whether the accuracy is reached.
    """
    longest_step = 1.9  # ᾱ relative to 1/‖H‖; less than 2
    p, dot, longest = program, program.dot, longest_step / program.norm

    def preconditioned(free: Floats) -> Floats:
        return np.where(p.x <= p.lower, 0.0, p.precondition(free))

    parts = split(p.gradient, p.x, p.lower, longest)
    direction: Floats | None = None
    while True:
        projected = parts.projected
        if enough(p.x, float(np.sqrt(dot(projected, projected)))):
            return True
        if p.products >= most:
            return False
        if dot(parts.chopped, parts.chopped) > dot(parts.reduced, parts.free):
            image = p.hessian(parts.chopped)
            step = dot(p.gradient, parts.chopped) / dot(parts.chopped, image)
            p.x = p.x - step * parts.chopped
            p.gradient = p.gradient - step * image
            p.products += 1
            direction = None
        else:
            if direction is None:
                direction = preconditioned(parts.free)
            image = p.hessian(direction)
            p.products += 1
            curvature = dot(direction, image)
            if not curvature > 0:
                return False
            step = dot(direction, p.gradient) / curvature
            reach = _reach(program, direction)
            if step <= reach:
                p.x = p.x - step * direction
                p.gradient = p.gradient - step * image
                parts = split(p.gradient, p.x, p.lower, longest)
                z = preconditioned(parts.free)
                direction = z - (dot(z, image) / curvature) * direction
                continue
            p.x = np.maximum(p.x - reach * direction, p.lower)
            p.gradient = p.gradient - reach * image
            free = split(p.gradient, p.x, p.lower, longest).free
            moved = np.maximum(p.x - longest * free, p.lower)
            p.gradient = p.gradient + p.hessian(moved - p.x)
            p.x = moved
            p.products += 1
            direction = None
        parts = split(p.gradient, p.x, p.lower, longest)


def _reach(program: BoundProgram, direction: Floats) -> float:
    """Return the largest s for which x − s·direction is feasible. Collective."""
    towards = direction > 0
    room = (program.x - program.lower)[towards] / direction[towards]
    return program.comm.allreduce(float(room.min(initial=np.inf)), MPI.MIN)


FIRST_BALANCE, SHRINK = 10.0, 0.1
"""Initial M relative to ‖A‖, and the factor of M if the Lagrangian has not increased enough."""


@dataclass(frozen=True)
class DualProgram:
    """The dual program to be minimised, with bounds and equalities.

    Attributes:
        comm: Communicator of the ranks that share the unknowns.
        multiply: Function x ↦ Ax for x in the kernel of Q; its result is in the kernel too.
        project: The projector P.
        precondition: Function that approximates A⁻¹; it must be symmetric positive definite on the
            kernel.
        norm: ‖A‖, or an estimate.
        b: Vector in the kernel of Q, shape (n,).
        lower: Bounds, −∞ if there is no bound, shape (n,).
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
    """The iteration for one program; later runs may continue to smaller tolerances.

    Attributes:
        multiplier: Multiplier μ, in the range of Q.
        projected: Norm of the current projected gradient.
        off: Current ‖Qx‖.
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
        """Return x, which lies exactly within the bounds."""
        return self._inner.x

    @property
    def products(self) -> int:
        """Return the number of products with A so far."""
        return self._inner.products

    def run(self, jumps: float, forces: float, most: int) -> bool:
        """Iterate, and return whether both tolerances are met. Collective.

        Args:
            jumps: Tolerance for the norm of the projected gradient.
            forces: Tolerance for ‖Qx‖.
            most: Largest total number of products with A.

        Returns:
            Whether both tolerances are met; they are never met if no point is feasible.
        """
        program, inner = self._program, self._inner

        # η: norm of the projected gradient that ends an inner iteration, relative to the first
        # gradient.
        loose = 0.1
        under = 0.5  # smallest fraction of the tolerance for inner iterations

        def enough(x: Floats, projected: float) -> bool:
            self.projected, self.off = projected, program.length(x - program.project(x))
            if projected <= jumps and self.off <= forces:
                return True
            wanted = min(self._balance * self.off, loose * self._first)
            return projected <= max(wanted, under * jumps)

        # If Qx is not small after this number of iterations, no point within the bounds lies in the
        # kernel of Q.
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
