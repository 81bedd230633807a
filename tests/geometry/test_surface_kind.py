"""Test splines and surfaces of revolution that are planes, cylinders or spheres."""

import gmsh
import pytest

from perfplast_fenicsx.geometry.free_faces import kind_of, round_of, shape_of
from perfplast_fenicsx.mesh import gmsh_session

pytestmark = pytest.mark.serial


def spline(places: list[tuple[float, float, float]], along: int) -> int:
    """Return a B-spline surface through control points, with some along its first parameter."""
    points = [gmsh.model.occ.addPoint(*place) for place in places]
    surface = int(gmsh.model.occ.addBSplineSurface(points, along, degreeU=2, degreeV=1))
    gmsh.model.occ.synchronize()
    return surface


def test_a_plane_given_as_a_spline() -> None:
    with gmsh_session():
        places = [(x, y, 0.5 * x) for y in (0.0, 2.0) for x in (0.0, 1.0, 3.0)]
        surface = spline(places, 3)
        assert gmsh.model.getType(2, surface) == "BSpline surface"
        assert kind_of(2, surface) == "Plane"
        assert shape_of(2, surface) == "flat"


def test_a_curved_spline_stays_one() -> None:
    with gmsh_session():
        places = [(x, y, x * x) for y in (0.0, 2.0) for x in (0.0, 1.0, 3.0)]
        surface = spline(places, 3)
        assert shape_of(2, surface) == "bspline"
        assert round_of(2, surface) == ""


@pytest.mark.parametrize(
    ("weights", "shape"), [([1.0, 0.5**0.5, 1.0] * 2, "cylindrical"), ([1.0] * 6, "bspline")]
)
def test_a_cylinder_given_as_a_rational_spline(weights: list[float], shape: str) -> None:
    """The middle of a quarter circle of radius 2 has the weight √½.

    With weight 1 the curve is a parabola.
    """
    with gmsh_session():
        quarter = [(2.0, 0.0), (2.0, 2.0), (0.0, 2.0)]
        points = [gmsh.model.occ.addPoint(x, y, z) for z in (0.0, 1.0) for x, y in quarter]
        surface = gmsh.model.occ.addBSplineSurface(points, 3, degreeU=2, degreeV=1, weights=weights)
        gmsh.model.occ.synchronize()
        assert shape_of(2, surface) == shape
        assert round_of(2, surface) == ("convex, R 2, along z" if shape == "cylindrical" else "")
