"""An upper bound of the limit load from a collapse mechanism that the laws admit.

For v with v = 0 on supports, no jump into the other body, and ε(v) admissible for the law of each
body, the limit load is at most (D(v) − L₀(v))/L₁(v) with D the dissipation, the support function of
the yield sets (kinematic theorem of limit analysis, E. Christiansen, Handbook of Numerical Analysis
IV, 1996). For von Mises admissible means div v = 0, and D(v) = ∫ γ‖dev ε(v)‖; for elastic bodies
ε(v) = 0. The increments of a loading come near such a v; here they are projected on it, for laws
that tell by a linear condition what is admissible.
"""

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass

from petsc4py import PETSc

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc

from perfplast_fenicsx.materials.mandel import strain
from perfplast_fenicsx.problem.integrals import Integral, assemble_force
from perfplast_fenicsx.problem.law_on_cells import LawExpression, OfLaw, integrate
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.problem.state import State
from perfplast_fenicsx.solvers.linear.petsc_options import BOUND, own_prefix

PENALTY = 1e6
"""Weight of the constraints against the distance to the given velocity."""

MOST_ITERATIONS = 30

EXACT = 1e-11
"""A strain rate that is inadmissible counts as none below this share of ‖ε(v)‖."""

ROUNDING = 1e-9
"""Jumps and work below this share of what they are made of count as none."""

LARGEST_PROBLEM = 60_000
"""Beyond so many unknowns the projection, which needs a factorisation, is not tried."""

FACTORISATION = {
    "ksp_type": "preonly",
    "pc_type": "lu",
    "pc_factor_mat_solver_type": "mumps",
    "mat_mumps_icntl_14": 100,  # more room to work in (%)
}


@dataclass(frozen=True)
class UpperBound:
    """(D(v) − L₀(v))/L₁(v), or None and the reason why there is none.

    Attributes:
        value: The bound.
        solves: Linear systems solved.
        reason: Why there is no bound; empty where there is one.
    """

    value: float | None
    solves: int
    reason: str = ""


def dissipation_bound(problem: Problem, velocity: fem.Function, state: State) -> UpperBound:
    """Upper bound from the projection of a velocity. Collective.

    Args:
        problem: The bodies and their loads.
        velocity: Velocity near a collapse mechanism.
        state: Where it collapses: pairs that push stay closed.
    """
    for on in problem.laws:
        if on.law.inadmissible(strain(velocity)) is None:
            name = type(on.law).__name__
            return UpperBound(None, 0, f"{name} has no linear condition for admissible rates")
    if problem.num_dofs > LARGEST_PROBLEM:
        return UpperBound(None, 0, f"there are more than {LARGEST_PROBLEM} unknowns")
    with ExitStack() as made:
        return _bound(problem, velocity, state, made)


def _bound(problem: Problem, velocity: fem.Function, state: State, made: ExitStack) -> UpperBound:
    """Project by the method of multipliers; what PETSc makes is destroyed with ``made``."""
    laws, basis, comm = problem.laws, problem.basis, problem.comm
    rate = strain(velocity)
    trial, test = strain(ufl.TrialFunction(problem.V)), strain(ufl.TestFunction(problem.V))
    v = fem.Function(problem.V)
    multipliers = {
        on: fem.Function(problem.space_at_points(on.law.inadmissible(rate).ufl_shape))
        for on in laws
    }
    ascents = {
        on: LawExpression(
            [on],
            multiplier.function_space,
            lambda on: multipliers[on] + PENALTY * on.law.inadmissible(strain(v)),
        )
        for on, multiplier in multipliers.items()
    }

    operator = integrate(
        laws,
        lambda on: (
            ufl.dot(trial, test)
            + PENALTY * ufl.dot(on.law.inadmissible(trial), on.law.inadmissible(test))
        ),
    )
    K = fem_petsc.assemble_matrix(fem.form(operator), problem.bcs)
    made.callback(K.destroy)
    K.assemble()
    A = K
    if problem.num_pairs:
        A = K.PtAP(basis.T)
        made.callback(A.destroy)
    closed = basis.index[state.active] + A.getOwnershipRange()[0]
    A.zeroRowsColumns(closed.astype(PETSc.IntType), diag=1.0)
    ksp = PETSc.KSP().create(comm)
    made.callback(ksp.destroy)
    ksp.setOptionsPrefix(own_prefix(BOUND, FACTORISATION))
    ksp.setOperators(A)
    ksp.setFromOptions()

    form = fem.form(
        integrate(
            laws,
            lambda on: ufl.dot(rate, test) - ufl.dot(multipliers[on], on.law.inadmissible(test)),
        )
    )
    remainder_size = _norm(problem, lambda on: on.law.inadmissible(strain(v)))
    size = _norm(problem, lambda on: strain(v))
    force, b, y = problem.create_vector(), A.createVecLeft(), A.createVecRight()
    for vector in (force, b, y):
        made.callback(vector.destroy)
    for solves in range(1, MOST_ITERATIONS + 1):
        assemble_force(force, form, problem.bcs)
        basis.T.multTranspose(force, b)
        b.array[closed - A.getOwnershipRange()[0]] = 0
        ksp.solve(b, y)
        if ksp.getConvergedReason() <= 0:
            return UpperBound(None, solves, "the projection cannot be solved")
        basis.T.mult(y, v.x.petsc_vec)
        v.x.scatter_forward()
        if remainder_size() <= EXACT * size():
            break
        for on, multiplier in multipliers.items():
            ascents[on].interpolate(multiplier)
    else:
        return UpperBound(None, MOST_ITERATIONS, "the projection does not converge")
    work = problem.loads.alpha(v.x.petsc_vec)
    jumps = y.array_r[basis.index][~state.active]
    largest = y.norm(PETSc.NormType.NORM_INFINITY)
    if comm.allreduce(int((jumps > ROUNDING * largest).sum())):
        return UpperBound(None, solves, "the mechanism closes open pairs")
    if work <= ROUNDING * problem.loads.live.norm() * largest:
        return UpperBound(None, solves, "the loads do no work on the mechanism")
    power = Integral(comm, integrate(laws, lambda on: on.law.dissipation(strain(v))))
    resisted = power() - float(problem.loads.dead.dot(v.x.petsc_vec))
    return UpperBound(resisted / work, solves)


def _norm(problem: Problem, value: OfLaw) -> Callable[[], float]:
    """L² norm of vectors that each law tells of, to be evaluated at each call."""
    square = integrate(problem.laws, lambda on: ufl.dot(value(on), value(on)))
    integral = Integral(problem.comm, square)
    return lambda: float(np.sqrt(integral()))
