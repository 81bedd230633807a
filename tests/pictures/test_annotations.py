"""Test arrows of loads, and rigid obstacles around the bodies."""

from dataclasses import replace

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx.contact.declared.obstacles import Cylinder, Obstacle, Plane, Sphere
from perfplast_fenicsx.io.case.scene import Scene
from perfplast_fenicsx.mesh.sample_meshes import build
from perfplast_fenicsx.pictures.annotations import load_arrows, sample_obstacles
from perfplast_fenicsx.pictures.renderer import acting, shares
from perfplast_fenicsx.problem.declared.loads import Pressure, Traction
from tests.io.results.test_result_folder import report
from tests.pictures.skins import skin, square

pytestmark = pytest.mark.serial

NEARBY: dict[str, list[Obstacle]] = {
    "plane": [Sphere("side", (0.5, 0.5), 0.75, hollow=True), Plane("side", (0.0, -0.02), (0, 2))],
    "space": [
        Cylinder("top", (0.0, 0.5, 3.0), (1, 0, 0), 1.0),
        Plane("top", (0, 0, 2.1), (0, 0, -1)),
    ],
}
"""Obstacles near the square, and near two blocks."""


@pytest.mark.parametrize("plane", [False, True])
def test_arrows_end_on_their_surface_or_pull_at_it(plane: bool) -> None:
    on, axis, end = ("side", 0, 1.0) if plane else ("top", 2, 2.0)
    out = np.eye(3)[axis]
    inward = (-2.0 * out)[: 2 if plane else 3]
    along = np.roll(out, 1)[: 2 if plane else 3]
    loads = [Traction(on, inward), Pressure(on, -3.0), Pressure(on, 1.0), Traction(on, along)]
    tagged_mesh = square(MPI.COMM_SELF) if plane else build(MPI.COMM_SELF, "two_blocks", n=2)
    for load, points_along in zip(loads, (-1, 1, -1, 0), strict=True):
        surface = skin(tagged_mesh, Scene("", [load]))
        arrows = load_arrows(surface, surface.points, [load])
        assert 5 < len(arrows.starts) < 40
        length = 0.1 * surface.size
        assert np.allclose(np.linalg.norm(arrows.vectors, axis=1), length)
        assert np.allclose(arrows.vectors[:, axis], points_along * length)
        pushes = points_along < 0
        touching = arrows.starts + arrows.vectors * pushes
        assert np.allclose(touching[:, axis], end)
        assert len(np.unique(np.round(touching, 9), axis=0)) == len(touching)


def test_a_strip_of_a_large_body_has_three_arrows() -> None:
    """Arrows have an eighth of the size of the body, unless they would overlap."""
    surface = skin(square(MPI.COMM_SELF), Scene("", [Traction("side", (-1.0, 0.0))]))
    narrow = surface.points.copy()
    narrow[:, 1] *= 0.12
    narrow[np.argmin(surface.points[:, 0] + surface.points[:, 1]), 1] = -1.0
    strip = replace(surface, points=narrow)
    arrows = load_arrows(strip, narrow, [Traction("side", (-1.0, 0.0))])
    assert len(arrows.starts) == 3


def test_no_arrows_of_a_load_that_is_zero() -> None:
    loads = [Traction("side", (0.0, 0.0)), Pressure("nowhere", 1.0)]
    surface = skin(square(MPI.COMM_SELF), Scene("", loads))
    assert load_arrows(surface, surface.points, loads).starts.shape == (0, 3)


@pytest.mark.parametrize("where", NEARBY)
def test_obstacles_are_sampled_around_the_bodies(where: str) -> None:
    comm = MPI.COMM_SELF
    tagged_mesh = square(comm) if where == "plane" else build(comm, "two_blocks", n=1)
    surface = skin(tagged_mesh, Scene(""))
    near = sample_obstacles(surface, surface.points, NEARBY[where])
    shape = near.distances[0].shape
    assert shape[2] == 1 or where == "space"
    far = near.corner + near.spacing * (np.array(shape) - 1)
    assert np.all(near.corner <= surface.points.min(axis=0))
    assert np.all(far >= surface.points.max(axis=0))
    for obstacle, distances in zip(NEARBY[where], near.distances, strict=True):
        assert distances.shape == shape
        assert distances.min() < 0 < distances.max()  # a part is in the picture
        i, j, k = 3, 2, min(shape[2] - 1, 1)
        x = near.corner + near.spacing * [i, j, k]
        gdim = 2 if where == "plane" else 3
        assert np.isclose(distances[i, j, k], obstacle.towards(x[None, :gdim])[0][0])


def test_an_obstacle_is_drawn_where_it_has_moved_to() -> None:
    surface = skin(square(MPI.COMM_SELF), Scene(""))
    floor = Plane("side", (0.0, 0.0), (0.0, 1.0), move=(0.3, 0.2))
    near, moved = (
        sample_obstacles(surface, surface.points, [floor], travels) for travels in ((), (0.5,))
    )
    assert np.allclose(moved.distances[0], near.distances[0] - 0.1)


def test_arrows_and_obstacles_follow_the_factors_of_stages() -> None:
    loads = [Pressure("side", 1.0, name="push"), Pressure("side", 1.0, constant=True)]
    floor = Plane("side", (0.0, 0.0), (0.0, 1.0), move=(0.3, 0.2), name="floor")
    reports = [
        report(zeta, plastic_cells=0, factors={"push": push, "floor": moved})
        for zeta, push, moved in ((1.0, -4.0, 0.1), (2.0, 2.0, -0.3))
    ]
    states = acting([None, *reports])
    assert [state.of_obstacle(floor) for state in states] == [0.0, 0.1, -0.3]
    assert shares(states, loads) == pytest.approx(np.array([[0, 1], [-1, 1], [0.5, 1]]))
    surface = skin(square(MPI.COMM_SELF), Scene("", loads))
    whole, half, none = (
        load_arrows(surface, surface.points, loads[:1], [share]) for share in (1.0, -0.5, 0.0)
    )
    assert np.allclose(half.vectors, -0.5 * whole.vectors)
    assert len(whole.starts) > 5
    assert len(none.starts) == 0


def test_without_stages_the_load_factor_decides() -> None:
    load, floor = Pressure("side", 1.0), Plane("side", (0.0, 0.0), (0.0, 1.0), move=(0.3, 0.2))
    states = acting([None, report(-2.0, plastic_cells=0, factors={})])
    assert [state.of_obstacle(floor) for state in states] == [0.0, -2.0]
    assert [state.of_load(load) for state in states] == [1.0, -1.0]
