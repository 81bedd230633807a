"""Test the output fields."""

from mpi4py import MPI

import numpy as np
import pytest
from dolfinx import fem

from perfplast_fenicsx import Newton, OutputFields, limit_bounds
from perfplast_fenicsx.io.results.output_fields import dissipation
from perfplast_fenicsx.materials.elastic import Elastic
from perfplast_fenicsx.mesh.sample_meshes import build
from perfplast_fenicsx.problem.declared.loads import Traction
from perfplast_fenicsx.problem.declared.supports import Support
from perfplast_fenicsx.problem.problem import Problem
from tests.models import STEEL
from tests.stones import box, stones


@pytest.mark.mpi2("1")
@pytest.mark.parametrize("degree", [1, 2])
def test_dissipation(comm: MPI.Intracomm, degree: int) -> None:
    tagged_mesh = build(comm, "two_blocks", n=1)
    materials = {"lower": Elastic(200e3, 0.3), "upper": STEEL}
    supports, loads = [Support("left")], [Traction("top", (0.0, 0.0, -1.0))]
    problem = Problem(tagged_mesh, materials, supports, loads, degree=degree)
    v = fem.Function(problem.V)
    v.interpolate(lambda x: np.stack([3 * x[1], 0 * x[1], 0 * x[1]]))  # ‖dev ε‖ = 3/√2
    v.x.scatter_forward()
    work = dissipation(problem, v)
    assert work.function_space.element.space_dimension == 1
    for name, expected in (("lower", 0.0), ("upper", STEEL.yield_radius * 3 / np.sqrt(2))):
        cells = tagged_mesh.cells(name)
        assert np.allclose(work.x.array[cells], expected, rtol=1e-12, atol=0)
    v.x.array[:] = 0
    assert not dissipation(problem, v).x.array.any()


def test_stresses_in_python(comm: MPI.Intracomm) -> None:
    """Test Mandel vectors, tensors in cells, and the mesh for the stress of bounds."""
    shear = 3.0
    problem = Problem(
        stones(comm, [box([0, 0, 0], [1, 1, 1])], (1, 1, 1)),
        {"0": Elastic(1e4, 0.3)},
        [Support("0_z0")],
        [Traction("0_z1", (shear, 0.0, 0.0))],
        degree=2,
    )
    level = Newton(problem).solve(1.0)
    mandel = level.stress.x.array.reshape(-1, 6)
    tensors = OutputFields(problem).update(level)["stress"].x.array.reshape(-1, 3, 3)
    points = len(mandel) // len(tensors)
    means = mandel.reshape(len(tensors), points, 6).mean(axis=1)
    places = [(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)]
    for component, (i, j) in enumerate(places):
        factor = 1.0 if i == j else np.sqrt(2)
        assert means[:, component] == pytest.approx(factor * tensors[:, i, j], abs=1e-9)
    assert np.abs(tensors[:, 0, 2]).max() > shear / 2


def test_the_mesh_of_a_stress_of_bounds(comm: MPI.Intracomm) -> None:
    cube = stones(comm, [box([0, 0, 0], [1, 1, 1])], (1, 1, 1))
    problem = Problem(
        cube,
        {"0": STEEL},
        [Support("0_z0", "z"), Support("0_x0", "x"), Support("0_y0", "y")],
        [Traction("0_z1", (0.0, 0.0, 1.0))],
        degree=2,
    )
    bounds = limit_bounds(problem)
    assert bounds.stress is not None
    owned = bounds.problem.tagged_mesh.mesh.topology.index_map(3).size_local
    assert bounds.stress.shape == (owned, 4, 6)
    cells = bounds.problem.tagged_mesh.mesh.topology.index_map(3).size_global
    assert cells == 4 * cube.mesh.topology.index_map(3).size_global
