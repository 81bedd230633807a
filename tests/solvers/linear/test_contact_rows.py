"""Test the rows of the operator near contact."""

from collections.abc import Callable

import pytest

from perfplast_fenicsx import Problem
from tests.models import two_blocks_problem
from tests.solvers.linear.systems import corner_problem, elastic_operator, quadratic_problem


@pytest.mark.mpi3("two blocks")
@pytest.mark.parametrize(
    "make",
    [lambda: two_blocks_problem(3), corner_problem, quadratic_problem],
    ids=["two blocks", "two normals", "quadratic"],
)
def test_the_matrix_is_that_of_the_whole_product(make: Callable[[], Problem]) -> None:
    """Only rows near contact are computed again; held pairs change."""
    problem = make()
    operator = elastic_operator(problem)
    index, T = problem.basis.index, problem.basis.T
    for held in (index[::2], index, index[:0]):
        operator.hold(held)
    whole = operator.nodal().PtAP(T)
    difference = operator.matrix.copy()
    difference.axpy(-1.0, whole)
    assert difference.norm() < 1e-14 * whole.norm()
