"""Test factorisations: accuracy, reuse, and checks."""

import pytest

from perfplast_fenicsx.solvers.linear import factorisation
from perfplast_fenicsx.solvers.linear.factorisation import Factorisation
from tests.models import two_blocks_problem
from tests.solvers.linear.systems import elastic_operator, loads


def test_factors_are_those_of_the_matrix_or_of_an_earlier_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """With old factors CG needs no more iterations than a new factorisation would cost."""
    problem = two_blocks_problem(2)
    index, b, x = problem.basis.index, loads(problem), problem.create_vector()
    operator, method = elastic_operator(problem), Factorisation(problem.comm)
    assert method.prepare(operator)
    operator.hold(index)
    method.set_matrix(operator, index)
    method.renew(None)
    assert method.solve(b, x, 1e-3).solved
    exact = x.copy()
    operator.hold(index[:0])
    method.set_matrix(operator, index[:0])
    method.keep()
    assert method.worth == 0  # for such a small matrix
    assert method.solve(b, x, 1e-8).failure == "diverged max it"
    monkeypatch.setattr(Factorisation, "worth", 200)
    outcome = method.solve(b, x, 1e-8)
    assert outcome.solved and outcome.iterations > 1
    kept = x.copy()
    method.renew(None)
    assert method.solve(b, x, 1e-3).solved
    assert (x - exact).norm() > 1e-3 * exact.norm()
    assert (x - kept).norm() < 1e-6 * x.norm()
    method.destroy()


def test_a_solution_that_leaves_most_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = two_blocks_problem(2)
    index, b, x = problem.basis.index, loads(problem), problem.create_vector()
    operator, method = elastic_operator(problem), Factorisation(problem.comm)
    operator.hold(index)
    method.set_matrix(operator, index)
    monkeypatch.setattr(factorisation, "USELESS", -1.0)
    outcome = method.solve(b, x, 1e-3)
    assert outcome.failure == "the solution leaves most of the right-hand side"
    assert outcome.iterations == 1


def test_after_a_singular_matrix_the_next_one_is_factorised() -> None:
    """PETSc would otherwise continue with factors that MUMPS does not have."""
    problem = two_blocks_problem(2)
    index, b, x = problem.basis.index, loads(problem), problem.create_vector()
    operator, method = elastic_operator(problem), Factorisation(problem.comm)
    operator.hold(index)
    for scale, solved in ((1.0, True), (0.0, False), (2.0, True), (1.0, True)):
        operator.hold(index)
        operator.matrix.scale(scale)
        method.set_matrix(operator, index)
        method.renew(None)
        assert method.solve(b, x, 1e-3).solved is solved
    method.destroy()
