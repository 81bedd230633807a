"""Test points beside the chords of a curve, and points that are not beside a chord."""

import numpy as np
import pytest

from perfplast_fenicsx.mesh.divided_surfaces import bulges, chord_points, farthest

pytestmark = pytest.mark.serial


def arc(sides: int, radius: float = 1.0, first: float = 0.0, last: float = np.pi / 2) -> np.ndarray:
    turn = np.linspace(first, last, sides + 1)
    x = radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    return np.stack([x[:-1], x[1:]], axis=1)


def test_points_of_another_polygon_of_the_circle_are_beside_one_chord_each() -> None:
    chords, others = arc(7), arc(11)
    points = np.unique(others.reshape(-1, 2), axis=0)
    chord, point, at = chord_points(chords, bulges(chords, chords), points)
    inside = np.hypot(*points.T) > 0
    inside[[0, -1]] = False  # the ends of both arcs
    np.testing.assert_array_equal(np.sort(point), np.flatnonzero(inside))
    assert (np.lexsort((at, chord)) == np.arange(len(at))).all()
    middle = points[point]
    turn = np.arctan2(middle[:, 1], middle[:, 0])
    np.testing.assert_array_equal(chord, np.floor(turn / (np.pi / 14)))


@pytest.mark.parametrize(("sides", "others"), [(7, 11), (4, 40), (40, 4), (6, 6)])
def test_how_far_a_circle_is_from_its_chords(sides: int, others: int) -> None:
    away = farthest(arc(sides), arc(others).reshape(-1, 2))
    sagitta = 1 - np.cos(np.pi / 4 / sides)
    assert away is not None
    assert away <= sagitta * (1 + 1e-9)
    if others % (2 * sides) == 0:
        assert away == pytest.approx(sagitta, rel=1e-9)
    if sides % others == 0:
        assert away == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("gap", [-0.05, 0.02])
def test_circles_that_are_apart_are_no_polygons_of_one(gap: float) -> None:
    assert farthest(arc(7), arc(11, 1 + gap).reshape(-1, 2)) is None


def test_points_beyond_a_surface_are_beside_nothing() -> None:
    assert farthest(arc(7, last=1.0), arc(11).reshape(-1, 2)) is None


def test_corners_and_straight_sides_are_no_curves() -> None:
    corner = np.array([[[0.0, 0.0], [1.0, 0.0]], [[1.0, 0.0], [1.0, 1.0]]])
    np.testing.assert_array_equal(bulges(corner, corner), 0.0)
    assert farthest(corner, np.array([[0.5, 0.0], [1.0, 0.3]])) == pytest.approx(0.0, abs=1e-14)
    assert farthest(corner, np.array([[0.5, 0.001]])) is None
