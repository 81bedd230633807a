"""Fields that people look at."""

from mpi4py import MPI

import numpy as np
import pytest
from dolfinx import fem

from perfplast_fenicsx.io.results.output_fields import dissipation
from perfplast_fenicsx.materials.elastic import Elastic
from perfplast_fenicsx.mesh.sample_meshes import build
from perfplast_fenicsx.problem.declared.loads import Traction
from perfplast_fenicsx.problem.declared.supports import Support
from perfplast_fenicsx.problem.problem import Problem
from tests.models import STEEL


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
