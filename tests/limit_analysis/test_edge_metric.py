"""Test the metric of edges of plane cells, from changes of mechanism and stress."""

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from demos.verification.bounded_bodies import PLATENS
from meshes.platens import write_platens
from perfplast_fenicsx import Problem, limit_bounds
from perfplast_fenicsx.limit_analysis.body.finer_meshes import edge_metric
from perfplast_fenicsx.mesh.straight_geometry import corners
from tests.models import Read

Floats = npt.NDArray[np.float64]


def layers(x: Floats) -> Floats:
    """Return layers y = constant that slide without dilation."""
    return np.stack([x[1] + x[1] ** 2, 0.0 * x[0]])


@pytest.mark.mpi3
def test_what_changes_along_an_edge(read: Read) -> None:
    """The velocity changes along y, and the stress along x + y."""
    problem = Problem(
        read(write_platens, **PLATENS.arguments),
        PLATENS.materials,
        PLATENS.supports,
        PLATENS.loads,
        degree=2,
    )
    found = limit_bounds(problem, 1e-2)
    found.mechanism.interpolate(layers)
    cells, points = corners(problem.tagged_mesh.mesh)
    stress = np.zeros((len(cells), 3, 4))
    stress[..., 3] = 5.0 + points[cells].sum(axis=2)
    metric = edge_metric(replace(found, stress=stress))
    assert metric is not None
    longest = 8.0
    along, across = np.diag([longest**-2, 1.0]), np.full((2, 2), 0.5)
    turned = across + longest**-2 * (np.eye(2) - across)
    np.testing.assert_allclose(metric, np.broadcast_to(along + 3 * turned, metric.shape), atol=1e-9)
    assert edge_metric(replace(found, shares=None)) is None
