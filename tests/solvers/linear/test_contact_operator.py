"""Test the operator in the jump basis."""

import numpy as np

from tests.models import two_blocks_problem
from tests.solvers.linear.systems import elastic_operator


def test_products_with_the_operator_are_those_with_its_matrix() -> None:
    problem = two_blocks_problem(3)
    operator = elastic_operator(problem)
    operator.hold(problem.basis.index[:0])
    y, r, f, image = (problem.loads.live.duplicate() for _ in range(4))
    y.array[:] = np.sin(np.arange(*y.getOwnershipRange()))
    r.array[:] = np.cos(np.arange(*y.getOwnershipRange()))
    operator.mult_add(y, r, f)
    operator.matrix.multAdd(y, r, image)
    image.axpy(-1.0, f)
    assert image.norm() < 1e-12 * f.norm()
