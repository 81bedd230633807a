"""Corners of one cell: those that could carry no load are divided, and no others."""

from mpi4py import MPI

import pytest

from perfplast_fenicsx import (
    Adaptation,
    Pressure,
    Problem,
    Support,
    Traction,
    adaptive_bounds,
    limit_bounds,
)
from perfplast_fenicsx.limit_analysis.lone_corners import with_divided_corners
from perfplast_fenicsx.problem.loads import Load
from tests.limit_analysis.test_interior_point import SOIL, K
from tests.limit_analysis.test_static_bound import quarters

CELLS = 8


def square(comm: MPI.Intracomm, load: Load) -> Problem:
    """Triangles alone in the corners at the right of the top and at the left of the bottom."""
    return Problem(quarters(comm), {"block": SOIL}, [Support("bottom")], [load], degree=2)


def count(problem: Problem) -> int:
    """Cells of all ranks."""
    number: int = problem.tagged_mesh.mesh.topology.index_map(2).size_global
    return number


@pytest.mark.mpi3
def test_shear_beside_a_free_side(comm: MPI.Intracomm) -> None:
    problem = square(comm, Traction("top", (1.0, 0.0)))
    bounds = limit_bounds(problem)
    assert count(bounds.problem) == CELLS + 2  # with the cell beyond the edge that is cut
    assert bounds.strict
    assert bounds.lower.value is not None
    assert bounds.upper.value is not None
    assert 0.1 * K < bounds.lower.value < K  # sheared all through it would carry K
    assert bounds.lower.value < bounds.upper.value
    adapted = adaptive_bounds(problem, Adaptation(until=0.5, cells=2 * CELLS))
    assert adapted.rounds[0].lower == pytest.approx(bounds.lower.value, rel=1e-8)


def test_what_one_cell_carries_is_left_alone(comm: MPI.Intracomm) -> None:
    for load in (Pressure("top", 1.0), Traction("top", (0.0, -1.0))):
        problem = square(comm, load)
        assert with_divided_corners(problem) is problem
