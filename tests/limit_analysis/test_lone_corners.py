"""Test corners of one cell: the program divides only those that could not carry loads."""

from mpi4py import MPI

import numpy as np
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
from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.body.singular_points import with_divided_corners
from perfplast_fenicsx.limit_analysis.facets.stress_cells import cell_layout, strain_matrices
from perfplast_fenicsx.problem.declared.loads import Load
from tests.limit_analysis.test_interior_point import SOIL, K
from tests.limit_analysis.test_static_bound import quarters

CELLS = 8


def square(comm: MPI.Intracomm, load: Load) -> Problem:
    """Return a square with lone triangles in the top right and the bottom left corner."""
    return Problem(quarters(comm), {"block": SOIL}, [Support("bottom")], [load], degree=2)


def count(problem: Problem) -> int:
    """Return the number of cells on all ranks."""
    number: int = problem.tagged_mesh.mesh.topology.index_map(2).size_global
    return number


@pytest.mark.mpi3
def test_shear_beside_a_free_side(comm: MPI.Intracomm) -> None:
    problem = square(comm, Traction("top", (1.0, 0.0)))
    bounds = limit_bounds(problem)
    assert count(bounds.problem) == CELLS + 2  # and the cell across the cut edge
    assert bounds.strict
    assert bounds.lower.value is not None
    assert bounds.upper.value is not None
    assert 0.1 * K < bounds.lower.value < K  # uniform shear would carry K
    assert bounds.lower.value < bounds.upper.value
    adapted = adaptive_bounds(problem, Adaptation(until=0.5, cells=2 * CELLS))
    assert adapted.rounds[0].lower == pytest.approx(bounds.lower.value, rel=1e-8)


def test_what_one_cell_carries_is_left_alone(comm: MPI.Intracomm) -> None:
    for load in (Pressure("top", 1.0), Traction("top", (0.0, -1.0))):
        problem = square(comm, load)
        assert with_divided_corners(problem) is problem


def test_the_parts_of_a_cell_in_space_bear_any_tractions_in_its_corners() -> None:
    """Test the matrix of tractions at a vertex, on facets of the cell and between its parts."""
    layout = cell_layout(3)
    axes = np.tile(np.eye(3), (1, 4, 1, 1))
    random = np.random.default_rng(1)
    for _ in range(5):
        rows_of_points, _ = strain_matrices(random.normal(size=(1, 4, 3)), axes)
        for vertex in range(4):
            blocks: dict[int, list[tuple[int, Floats]]] = {}
            parts = [part for part in range(4) if vertex in layout.corners[part]]
            for place, part in enumerate(parts):
                at = list(layout.corners[part]).index(vertex)
                found = rows_of_points[0, 4 * part + at, 3:]
                for row, values in zip(layout.rows[part, at, 1:].ravel(), found, strict=True):
                    blocks.setdefault(int(row), []).append((place, values))
            matrix = np.zeros((len(blocks), 3, 6))
            for row, entries in zip(matrix, blocks.values(), strict=True):
                for place, values in entries:
                    row[place] += values
            assert matrix.shape == (18, 3, 6)
            scaled = matrix.reshape(18, 18) / np.linalg.norm(matrix, axis=(1, 2))[:, None]
            assert np.linalg.matrix_rank(scaled, tol=1e-9) == 18
