"""Test Krylov methods with the user's preconditioner."""

import pytest

from perfplast_fenicsx.solvers.linear.krylov import Krylov
from perfplast_fenicsx.solvers.linear.petsc_options import default
from tests.models import two_blocks_problem
from tests.solvers.linear.systems import elastic_operator, loads

JACOBI = {"ksp_type": "cg", "ksp_norm_type": "unpreconditioned", "pc_type": "jacobi"}


@pytest.mark.parametrize(("asked", "reached"), [("1e-2", 1e-4), ("1e-7", 1e-7)])
def test_users_may_ask_for_more_than_a_step_needs(asked: str, reached: float) -> None:
    problem = two_blocks_problem(2)
    operator, b, x = elastic_operator(problem), loads(problem), problem.create_vector()
    operator.hold(problem.basis.index)
    with default("perfplast_ksp_rtol", asked):
        method = Krylov(problem.comm, JACOBI)
    method.set_matrix(operator, problem.basis.index)
    outcome = method.solve(b, x, 1e-4)
    assert outcome.solved
    residual = problem.create_vector()
    operator.matrix.mult(x, residual)
    residual.axpy(-1.0, b)
    assert 1e-3 * reached < residual.norm() / b.norm() <= 1.01 * reached
    method.destroy()


def test_why_an_iteration_ended_is_told() -> None:
    problem = two_blocks_problem(2)
    operator, b, x = elastic_operator(problem), loads(problem), problem.create_vector()
    operator.hold(problem.basis.index)
    method = Krylov(problem.comm, JACOBI | {"ksp_max_it": 3})
    method.set_matrix(operator, problem.basis.index)
    outcome = method.solve(b, x, 1e-8)
    assert not outcome.solved
    assert (outcome.iterations, outcome.failure) == (3, "diverged max it")
    method.destroy()
