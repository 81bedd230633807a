"""Test lines in the plane: their intersections, and the faces between them."""

import numpy as np
import pytest

from perfplast_fenicsx.geometry.plane_arrangement import Arrangement, arrange, crossings, within

pytestmark = pytest.mark.serial

SQUARE = np.array([[0.0, 0], [4, 0], [4, 4], [0, 4]])


def sides(polygon: np.ndarray) -> np.ndarray:
    return np.stack([polygon, np.roll(polygon, -1, axis=0)], axis=1)


def of(*parts: np.ndarray) -> Arrangement:
    owner = [number for number, part in enumerate(parts) for _ in part]
    return arrange(np.concatenate(parts), owner)


def test_areas_of_random_lines_are_those_of_shapely() -> None:
    shapely = pytest.importorskip("shapely")
    rng = np.random.default_rng(7)
    segments = np.concatenate([sides(SQUARE), rng.uniform(0, 4, (25, 2, 2))])
    plan = arrange(segments, [0] * len(segments))
    lines = shapely.node(shapely.MultiLineString(list(segments)))
    theirs = shapely.get_parts(shapely.polygonize(list(lines.geoms)))
    np.testing.assert_allclose(
        sorted(face.area for face in plan.faces),
        sorted(polygon.area for polygon in theirs),
        rtol=1e-8,
        atol=1e-9,
    )
    assert sum(face.area for face in plan.faces) == pytest.approx(16)
    for face in plan.faces:
        inside = [polygon for polygon in theirs if polygon.contains(shapely.Point(face.point))]
        assert len(inside) == 1 and inside[0].area == pytest.approx(face.area, rel=1e-8)


def test_lines_that_lie_on_each_other_are_one() -> None:
    right = SQUARE + np.array([4, 1])
    plan = of(sides(SQUARE), sides(right))
    assert sorted(face.area for face in plan.faces) == pytest.approx([16, 16])
    both = plan.owners.all(axis=1)
    assert both.sum() == 1
    assert plan.points[plan.edges[both][0]].tolist() in ([[4, 1], [4, 4]], [[4, 4], [4, 1]])
    assert (plan.sides[both] >= 0).all()


def test_a_hole_belongs_to_the_face_around_it() -> None:
    plan = of(sides(SQUARE), sides(SQUARE / 4 + 1), sides(SQUARE / 16 + 1.1))
    areas = sorted((face.area, len(face.loops)) for face in plan.faces)
    assert areas == [
        (pytest.approx(1 / 16), 1),
        (pytest.approx(1 - 1 / 16), 2),
        (pytest.approx(15), 2),
    ]
    polygon = SQUARE / 4 + 1
    for face in plan.faces:
        assert within(polygon, face.point[None])[0] == (face.area < 2)


@pytest.mark.parametrize("end", [(2.0, 2.0), (2.0, 4.0)])
def test_a_line_that_divides_nothing_lies_in_its_face(end: tuple[float, float]) -> None:
    dangling = np.array([[[2.0, -1.0], end]])
    plan = of(sides(SQUARE), dangling)
    faces = [(len(face.inside), face.area) for face in plan.faces]
    assert faces == ([(1, 16)] if end[1] < 4 else [(0, 8), (0, 8)])
    below = plan.points[plan.edges].min(axis=1)[:, 1] < 0
    assert (plan.sides[below] == -1).all()


def test_points_that_rounding_parts_are_one() -> None:
    nearly = np.array([[[4.0, 1.0], [4.0 + 1e-12, 3.0]]])
    plan = of(sides(SQUARE), nearly)
    assert len(plan.faces) == 1 and len(plan.points) == 6
    assert plan.owners.all(axis=1).sum() == 1


def test_crossings_have_their_place() -> None:
    found = list(crossings(np.array([[[0.0, 0], [4, 4]], [[0, 2], [4, 2]], [[0, 3], [4, 3.0]]])))
    assert [(i, j) for i, j, _ in found] == [(0, 1), (0, 2)]
    assert found[0][2] == pytest.approx([2, 2])
