"""Test view directions: pictures of meshes and results show the same side."""

import dataclasses
from itertools import product

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx.io.case.scene import Scene
from perfplast_fenicsx.mesh.sample_meshes import build
from perfplast_fenicsx.pictures.picture_file import BACK, FRONT, LEFT, PLANE, RIGHT, view_of
from tests.pictures.skins import skin, square

pytestmark = pytest.mark.serial


def test_results_are_seen_from_the_side_of_the_first_picture_of_bodies() -> None:
    """The stress is equal everywhere; the view is from behind if only this shows the loads."""
    surface = skin(build(MPI.COMM_SELF, "two_blocks", n=1), Scene(""))
    marks = surface.marks | {"contact": np.zeros(len(surface.facets), dtype=bool)}

    def seen(ratios: np.ndarray) -> object:
        at_cells = {"yield_ratio": ratios}
        return view_of(dataclasses.replace(surface, at_cells=at_cells, marks=marks), False)

    assert seen(np.ones(len(surface.triangles))) is FRONT
    assert seen((surface.normals @ BACK.towards > 0).astype(float)) is BACK
    plane = skin(square(MPI.COMM_SELF), Scene(""))
    assert view_of(plane, axisymmetric=False) is PLANE


def test_each_face_is_seen_from_one_of_each_pair() -> None:
    for one, other in ((FRONT, BACK), (LEFT, RIGHT)):
        assert np.allclose(np.add(one.towards, other.towards), 0.0)
    right, up, out = FRONT.frame
    assert np.linalg.det(FRONT.frame) == pytest.approx(1.0)
    assert up @ [0.0, 0.0, 1.0] > 0
    assert right @ out == pytest.approx(0.0)


@pytest.mark.parametrize("size", [(1.0, 1.0, 9.0), (9.0, 1.0, 1.0), (1.0, 9.0, 1.0)])
def test_a_picture_shows_whole_bodies(size: tuple[float, float, float]) -> None:
    """The picture of a case cut off tall bodies."""
    corners = np.array(list(product((2.0, 3.0), repeat=3))) * size
    for view in (FRONT, BACK, LEFT, RIGHT):
        centre, half_height = view.fitted(corners, (1000, 500))
        across, up = ((corners - centre) @ view.frame.T)[:, :2].T
        assert np.max(np.abs(across)) < 2 * half_height
        assert np.max(np.abs(up)) < half_height
        assert max(np.max(np.abs(across)) / 2, np.max(np.abs(up))) > 0.95 * half_height
