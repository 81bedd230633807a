"""Test 3D edges at which a shear traction ends: only edges with too few cells are divided."""

from mpi4py import MPI

import pytest

from perfplast_fenicsx import Pressure, Problem, Support, Traction, VonMises, limit_bounds
from perfplast_fenicsx.limit_analysis.body.singular_points import with_sheared_edges_divided
from perfplast_fenicsx.limit_analysis.stress.static_bound import strict_lower_bound
from perfplast_fenicsx.mesh.sample_meshes import Box, Surface, structured_mesh
from perfplast_fenicsx.problem.declared.loads import Load

K = 100.0
STEEL = VonMises(young=2e5, poisson=0.3, yield_stress=K * 3**0.5)


def lever(comm: MPI.Intracomm, load: Load) -> Problem:
    """Write a plate held at one face; some edges of the opposite face belong to one cell."""
    mesh = structured_mesh(
        comm,
        [Box("lever", (0, 0, 0), (0.2, 1, 1), (1, 2, 2))],
        [
            Surface("wall", ("lever",), lambda x: x[0] == 0),
            Surface("end", ("lever",), lambda x: x[0] == 0.2),
        ],
    )
    return Problem(mesh, {"lever": STEEL}, [Support("wall")], [load], degree=2)


def count(problem: Problem) -> int:
    """Return the number of cells on all ranks."""
    number: int = problem.tagged_mesh.mesh.topology.index_map(3).size_global
    return number


@pytest.mark.mpi3
def test_a_shear_that_ends_at_edges(comm: MPI.Intracomm) -> None:
    given = lever(comm, Traction("end", (0.0, 0.0, -1.0)))
    divided = with_sheared_edges_divided(given)
    assert count(divided) == 36 > count(given)
    assert with_sheared_edges_divided(divided) is divided
    alone = strict_lower_bound(given, 1e-3).bound.value
    bounds = limit_bounds(given, 1e-3)
    assert bounds.strict
    assert alone is not None
    assert bounds.lower.value is not None
    assert bounds.upper.value is not None
    assert count(bounds.problem) == 4 * count(divided)
    assert 2 * alone < bounds.lower.value < bounds.upper.value < K  # under uniform shear


def test_what_pulls_along_the_sides_is_left_alone(comm: MPI.Intracomm) -> None:
    for load in (Pressure("end", 1.0), Traction("end", (1.0, 0.0, 0.0))):
        problem = lever(comm, load)
        assert with_sheared_edges_divided(problem) is problem
