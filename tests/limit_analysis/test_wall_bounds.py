"""Test a wall with friction on cohesionless ground that extends below the toe: upper bounds."""

import pytest

from demos.verification.wall_bounds import PUSHED, beside
from meshes.retaining_wall import write_retaining_wall
from perfplast_fenicsx import limit_bounds
from tests.models import Read


@pytest.mark.mpi2
def test_a_wall_that_is_pushed_has_both_bounds(read: Read) -> None:
    bounds = limit_bounds(beside(read(write_retaining_wall, width=3.0), PUSHED), 1e-3)
    assert bounds.strict
    assert 3.2 < (bounds.lower.value or 0.0) < PUSHED.exact
    assert PUSHED.exact < (bounds.upper.value or 0.0) < 5.0
