"""Systems with held pairs: a correction for other pairs is as good as a solution, and cheaper."""

from petsc4py import PETSc

import numpy as np
import pytest

from perfplast_fenicsx.problem.quadrature_fields import QuadratureFields
from perfplast_fenicsx.problem.stiffness import Stiffness
from perfplast_fenicsx.solvers.active_set.equality_qp import EqualityProgram
from perfplast_fenicsx.solvers.linear.contact_operator import ContactOperator
from perfplast_fenicsx.solvers.linear.linear_solver import LinearSolver
from perfplast_fenicsx.solvers.linear.petsc_options import default
from tests.models import two_blocks_problem

RTOL = 1e-6


@pytest.mark.mpi3
@pytest.mark.parametrize("work", [None, 0.02])
@pytest.mark.parametrize("kind", ["mg", "cholesky"])
def test_a_correction_is_as_good_as_a_solution(kind: str, work: float | None) -> None:
    """The pair in one corner is let go."""
    problem = two_blocks_problem(4)
    fields = QuadratureFields(problem)
    fields.update()
    K = Stiffness(fields).assemble(1.0)
    with (
        default("perfplast_pc_type", kind),
        default("perfplast_coarse_pc_gamg_coarse_eq_limit", "60"),
    ):
        linear = LinearSolver(problem)
        system = EqualityProgram(problem, linear)
        operator = ContactOperator(problem, K)
        system.set_operator(operator)
    index = problem.basis.index
    before = np.ones(len(index), dtype=bool)
    x = problem.V.tabulate_dof_coordinates()[index // 3]
    after = (x[:, 0] < 2.9) | (x[:, 1] < 0.9)
    room = np.zeros(len(index))
    r, afresh, corrected, gradient = (problem.create_vector() for _ in range(4))
    problem.basis.T.multTranspose(problem.loads.live, r)
    r.scale(-100.0)

    multiplier = system.minimise(after, room, r, work, RTOL, afresh)
    dear = linear.iterations
    system.set_operator(operator)
    first = system.minimise(before, room, r, work, RTOL, corrected)
    linear.iterations = 0
    again = system.minimise(after, room, r, work, RTOL, corrected, first)
    if kind == "mg":
        assert 0 < linear.iterations < dear
    assert again == pytest.approx(multiplier, rel=1e-5)
    if work is not None:
        border = problem.create_vector()
        problem.basis.T.multTranspose(problem.loads.live, border)
        assert border.dot(corrected) == pytest.approx(work, rel=1e-12)
    system.gradient(corrected, r, again, gradient)
    gradient.array[index[after]] = 0
    allowed = RTOL * r.norm() * (1 if work is None else 3)
    assert gradient.norm() <= 1.1 * allowed
    assert not corrected.array_r[index[after]].any()
    corrected.axpy(-1.0, afresh)
    assert corrected.norm() < 1e-4 * afresh.norm()


@pytest.mark.mpi3
def test_what_is_right_already_is_left_alone() -> None:
    problem = two_blocks_problem(2)
    fields = QuadratureFields(problem)
    fields.update()
    K = Stiffness(fields).assemble(1.0)
    linear = LinearSolver(problem)
    system = EqualityProgram(problem, linear)
    system.set_operator(ContactOperator(problem, K))
    held = np.ones(len(problem.basis.index), dtype=bool)
    r, delta = problem.create_vector(), problem.create_vector()
    problem.basis.T.multTranspose(problem.loads.live, r)
    multiplier = system.minimise(held, np.zeros(held.size), r, None, RTOL, delta)
    solution = delta.copy()
    system.minimise(held, np.zeros(held.size), r, None, RTOL, delta, multiplier)
    assert linear.solves == 1
    solution.axpy(-1.0, delta)
    assert solution.norm(PETSc.NormType.NORM_INFINITY) == 0.0
