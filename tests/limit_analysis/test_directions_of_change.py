"""Test along which edges meshes for bounds in 3D are refined."""

from dataclasses import replace

import numpy as np
import pytest
from dolfinx import fem

from perfplast_fenicsx import Problem, limit_bounds
from perfplast_fenicsx.limit_analysis.body.finer_meshes import directions_of_change
from perfplast_fenicsx.mesh.straight_geometry import corners
from tests.models import two_blocks_problem


@pytest.mark.mpi3
def test_linear_fields_change_along_their_gradients() -> None:
    """This holds in each cell before the split, for any sizes; a pressure does not count."""
    linear = two_blocks_problem(1)
    problem = Problem.from_given(linear.tagged_mesh, replace(linear.given, degree=2))
    found = limit_bounds(problem, rtol=0.1)
    shear = fem.Function(found.mechanism.function_space)
    shear.interpolate(lambda x: np.stack([300.0 * x[2], 0.0 * x[2], 0.0 * x[2]]))
    cells, points = corners(found.problem.tagged_mesh.mesh)
    stress = np.zeros((len(cells), 4, 6))
    stress[..., :3] = points[cells][..., :1]
    stress[..., 3] = 0.02 * points[cells][..., 1]
    changes = directions_of_change(replace(found, mechanism=shear, stress=stress))
    expected = np.zeros((len(cells) // 4, 3, 9))
    expected[:, 2, 0] = 1.0
    expected[:, 1, 6] = 0.5
    np.testing.assert_allclose(changes, expected, atol=2e-4)
    alone = directions_of_change(replace(found, mechanism=shear, stress=None))
    np.testing.assert_allclose(alone, expected[..., :3], atol=2e-4)
