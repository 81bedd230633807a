"""An upper bound of the limit load from a discretely incompressible collapse mechanism.

For v with v = 0 on supports, no jump into the other body, div v = 0 in plastic bodies and ε(v) = 0
in elastic ones, the limit load is at most D(v)/L(v) with D(v) = ∫ γ‖dev ε(v)‖ (kinematic theorem
of limit analysis, E. Christiansen, Handbook of Numerical Analysis IV, 1996). The increments of a
loading come near such a v; here they are projected on it.
"""

from collections.abc import Callable
from dataclasses import dataclass

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc

from perfplast_fenicsx.compat import interpolation_points
from perfplast_fenicsx.materials.mandel import deviator, spherical, strain, trace
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.problem.quadrature_fields import Integral, assemble_force
from perfplast_fenicsx.problem.state import State

PENALTY = 1e6
"""Weight of the constraints against the distance to the given velocity."""

MOST_ITERATIONS = 30

EXACT = 1e-11
"""Volume change (and strain of elastic bodies) that counts as none, relative to ‖ε(v)‖."""

ROUNDING = 1e-9
"""Jumps and work below this share of what they are made of count as none."""

LARGEST_PROBLEM = 60_000
"""Beyond so many unknowns the projection, which needs a factorisation, is not tried."""


@dataclass(frozen=True)
class UpperBound:
    """D(v)/L(v), or None where the projection has not succeeded, and the solves that took."""

    value: float | None
    solves: int


def dissipation_bound(problem: Problem, velocity: fem.Function, state: State) -> UpperBound:
    """Upper bound from the projection of a velocity. Collective.

    Args:
        problem: The bodies and their loads.
        velocity: Velocity near a collapse mechanism.
        state: Where it collapses: pairs that push stay closed.
    """
    if problem.num_dofs > LARGEST_PROBLEM:
        return UpperBound(None, 0)
    law, dx, comm = problem.moduli, problem.dx, problem.comm
    plastic = ufl.conditional(law.may_yield(), 1.0, 0.0)
    v, multiplier = fem.Function(problem.V), fem.Function(problem.S)

    def forbidden(e: ufl.core.expr.Expr) -> ufl.core.expr.Expr:
        """The part of a strain that must vanish: all of it in elastic bodies."""
        return spherical(trace(e) / 3, len(e)) + (1 - plastic) * deviator(e)

    trial, test = strain(ufl.TrialFunction(problem.V)), strain(ufl.TestFunction(problem.V))
    operator = ufl.dot(trial, test) + PENALTY * ufl.dot(forbidden(trial), forbidden(test))
    K = fem_petsc.assemble_matrix(fem.form(operator * dx), problem.bcs)
    K.assemble()
    A = K.PtAP(problem.basis.T) if problem.num_pairs else K
    closed = problem.basis.index[state.active] + A.getOwnershipRange()[0]
    A.zeroRowsColumns(closed.astype(PETSc.IntType), diag=1.0)
    ksp = PETSc.KSP().create(comm)
    ksp.setOperators(A)
    ksp.setType("preonly")
    ksp.getPC().setType("lu")
    ksp.getPC().setFactorSolverType("mumps")
    ksp.getPC().setFactorSetUpSolverType()
    ksp.getPC().getFactorMatrix().setMumpsIcntl(14, 100)  # more room to work in (%)

    right = ufl.dot(strain(velocity), test) - ufl.dot(multiplier, forbidden(test))
    form = fem.form(right * dx)
    remainder = forbidden(strain(v))
    ascent = fem.Expression(
        multiplier + PENALTY * remainder, interpolation_points(problem.S.element)
    )
    remainder_size, size = (_norm(comm, e, dx) for e in (remainder, strain(v)))
    force, b, y = problem.create_vector(), A.createVecLeft(), A.createVecRight()
    for solves in range(1, MOST_ITERATIONS + 1):
        assemble_force(force, form, problem.bcs)
        problem.basis.T.multTranspose(force, b)
        b.array[closed - A.getOwnershipRange()[0]] = 0
        ksp.solve(b, y)
        if ksp.getConvergedReason() <= 0:
            return UpperBound(None, solves)
        problem.basis.T.mult(y, v.x.petsc_vec)
        v.x.scatter_forward()
        if remainder_size() <= EXACT * size():
            break
        multiplier.interpolate(ascent)
    else:
        return UpperBound(None, MOST_ITERATIONS)
    work = problem.loads.alpha(v.x.petsc_vec)
    jumps = y.array_r[problem.basis.index][~state.active]
    largest = y.norm(PETSc.NormType.NORM_INFINITY)
    entering = comm.allreduce(int((jumps > ROUNDING * largest).sum()))
    if entering or work <= ROUNDING * problem.loads.live.norm() * largest:
        return UpperBound(None, solves)
    return UpperBound(Integral(comm, law.dissipation(strain(v)) * dx)() / work, solves)


def _norm(comm: MPI.Intracomm, e: ufl.core.expr.Expr, dx: ufl.Measure) -> Callable[[], float]:
    """L² norm of a Mandel vector, to be evaluated at each call."""
    integral = Integral(comm, ufl.dot(e, e) * dx)
    return lambda: float(np.sqrt(integral()))
