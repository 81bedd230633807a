"""Test that halves on different meshes of one body are equal, also far from the origin."""

from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx import Pressure, Problem, Support, VonMises
from perfplast_fenicsx.limit_analysis import limit_bounds
from perfplast_fenicsx.mesh.refinement import refine
from perfplast_fenicsx.proof.body import Body
from perfplast_fenicsx.proof.halves import differences
from tests.proof.forging import written
from tests.symmetric_bodies import built

pytestmark = pytest.mark.serial


@pytest.mark.parametrize("far", [1e-3, 1e2, 1e4])
def test_a_turned_square_is_one_body(far: float, tmp_path: Path) -> None:
    """The rounding of coordinates changes the direction of a pressure and of a support's normal."""
    random = np.random.default_rng(3)
    points = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.5, 0.6]])
    cells = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
    places = {
        "bottom": lambda x: np.abs(x[1]) < 1e-9,
        "left": lambda x: np.abs(x[0]) < 1e-9,
        "top": lambda x: np.abs(x[1] - 1) < 1e-9,
    }
    square = built(MPI.COMM_SELF, points, cells, places, 0.3)
    square.mesh.geometry.x[:, :2] += far * random.normal(size=2)
    found = []
    for _ in range(2):
        mesh = square
        for _ in range(4):
            marks = random.random(mesh.mesh.topology.index_map(2).size_local) < 0.4
            mesh = refine(mesh, marks, np.zeros((0, 2), dtype=np.int64)).tagged_mesh
        supports = [Support("bottom"), Support("left", "normal")]
        body = {"body": VonMises(1e4, 0.3, 10.0)}
        problem = Problem(mesh, body, supports, [Pressure("top", 1.0)], degree=2)
        found.append(limit_bounds(problem, 1e-1))
    halves = written(tmp_path, *found)
    bodies = [Body.of(halves[kind]) for kind in ("lower", "upper")]
    assert len(bodies[0].cells) != len(bodies[1].cells)
    assert not differences(*bodies)
