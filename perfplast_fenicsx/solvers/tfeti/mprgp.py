"""Solve quadratic programs with bounds by MPRGP: CG on faces, expansion and proportioning.

Modified proportioning with reduced gradient projections (Z. Dostál, Optimal Quadratic Programming
Algorithms, Springer 2009, chapter 5), for

    minimise ½ xᵀHx − bᵀx  where  x ≥ lower

The gradient g is split into its free part φ (zero at bounds) and the chopped part β (which leaves
bounds). CG steps on the free unknowns continue while ‖β‖² ≤ φ̃ᵀφ, where φ̃ is φ limited to a step
of length ᾱ. A step that hits a bound stops there and continues with a projected step along −φ.
"""

from collections.abc import Callable
from dataclasses import dataclass

from mpi4py import MPI

import numpy as np

from perfplast_fenicsx.arrays import Floats

Operator = Callable[[Floats], Floats]


@dataclass(frozen=True)
class Split:
    """A gradient at a point of the feasible set.

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
        """Return φ + β, zero at the solution."""
        return self.free + self.chopped


def split(gradient: Floats, x: Floats, lower: Floats, longest: float) -> Split:
    """Return the split of a gradient.

    Args:
        gradient: Gradient at x.
        x: Feasible point.
        lower: Bounds, −∞ for none.
        longest: Step length ᾱ.
    """
    at_bound = x <= lower
    free = np.where(at_bound, 0.0, gradient)
    chopped = np.where(at_bound, np.minimum(gradient, 0.0), 0.0)
    reduced = np.where(at_bound, 0.0, np.minimum((x - lower) / longest, gradient))
    return Split(free, chopped, reduced)


@dataclass
class BoundProgram:
    """The program to be minimised, and the present iterate.

    Attributes:
        hessian: Function x ↦ Hx.
        precondition: Function that approximates H⁻¹ on all unknowns; symmetric positive definite.
        comm: Ranks that share the unknowns.
        lower: Bounds.
        norm: ‖H‖, or an upper or near estimate.
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
    """Iterate, and return whether the accuracy was reached; ``x`` and ``gradient`` change.

    Collective.

    Args:
        program: The program to be minimised; x may be any feasible point.
        enough: Function of x and the norm of the projected gradient; the same on every rank.
        most: Largest total number of products with H.

    Returns:
        Whether it was reached.
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
    """Return the largest s for which x − s d is feasible. Collective."""
    towards = direction > 0
    room = (program.x - program.lower)[towards] / direction[towards]
    return program.comm.allreduce(float(room.min(initial=np.inf)), MPI.MIN)
