"""Interaction diagrams: exact sets between two proven polygons."""

import math
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from perfplast_fenicsx import InputError, Pressure, Problem, Support, Traction, VonMises
from perfplast_fenicsx.limit_analysis import Envelope, envelope
from perfplast_fenicsx.limit_analysis.body.interaction import _inner
from perfplast_fenicsx.mesh.box_mesh import Box, Surface, structured_mesh
from perfplast_fenicsx.pictures.envelope_picture import save_envelope

Y = 300.0
STEEL = VonMises(2e5, 0.3, Y)
ACROSS, ALONG = Pressure("x1", -1.0), Traction("z1", (0.0, 0.0, 1.0))


@pytest.fixture
def cube(comm: MPI.Intracomm) -> Problem:
    """An eighth of a cube that is pulled in two directions: von Mises' ellipse."""
    surfaces = [
        Surface(f"{axis}{end}", ("cube",), lambda x, i=i, end=end: x[i] == end)
        for i, axis in enumerate("xyz")
        for end in (0, 1)
    ]
    mesh = structured_mesh(comm, [Box("cube", (0, 0, 0), (1, 1, 1), (1, 1, 1))], surfaces)
    held = [Support(f"{axis}0", axis) for axis in "xyz"]
    return Problem(mesh, {"cube": STEEL}, held, [ALONG], degree=2)


def ellipse(angle: float) -> float:
    """Where the ray leaves a² − ab + b² ≤ Y²."""
    a, b = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    return Y / math.sqrt(a * a - a * b + b * b)


@pytest.mark.parametrize("around", [False, True])
def test_an_ellipse_is_between_the_polygons(around: bool, cube: Problem, tmp_path: Path) -> None:
    told = list[float]()
    found = envelope(
        cube,
        [ACROSS],
        [ALONG],
        directions=48 if around else 20,
        until=0.01,
        around=around,
        monitor=lambda angle, low, high: told.append(angle),
    )
    assert tuple(told) == found.directions
    assert len(told) < (48 if around else 20)
    assert found.gap <= 0.01
    for angle in [*np.arange(0.0, 361.0 if around else 90.5, 0.5), *found.directions]:
        exact, inner, outer = ellipse(angle), found.inner(angle), found.outer(angle)
        assert inner <= exact * (1 + 1e-9)
        assert outer >= exact * (1 - 1e-9)
        assert outer / inner <= 1.0101
    table = found.table()
    assert len(table) == (361 if around else 91)
    assert table[45]["carried"] == pytest.approx(found.inner(45.0), rel=1e-12)
    save_envelope(table, ("a", "b"), "A cube", tmp_path / "envelope.png")
    assert (tmp_path / "envelope.png").stat().st_size > 10_000


def test_loads_that_stay(cube: Problem) -> None:
    """A pull that stays moves the set, and what is carried without any load is not known."""
    mesh, dead = cube.tagged_mesh, 100.0
    stays = Traction("z1", (0.0, 0.0, dead), constant=True)
    held = cube.given.supports
    problem = Problem(mesh, {"cube": STEEL}, held, [stays, ACROSS], degree=2)
    found = envelope(problem, [ACROSS], [ALONG], directions=6, until=0.02)
    for a, b in found.carried:
        assert a * a - a * (b + dead) + (b + dead) ** 2 <= Y * Y * (1 + 1e-9)
    for p, q, r in found.sides:  # the support of the ellipse along (p, q)
        most = Y * math.sqrt((p * p + p * q + q * q) * 4 / 3) - q * dead
        assert r >= most * (1 - 1e-9)
    assert found.gap < 0.1


@pytest.mark.serial
def test_hulls_along_rays() -> None:
    """Random points, those that are opposite each other among them: never beyond their hull."""
    random = np.random.default_rng(7)
    for _ in range(50):
        points = random.normal(size=(random.integers(3, 9), 2)) + random.normal(size=2)
        points = np.vstack([points, -points[0] * random.uniform(0.5, 2)])
        angles = np.concatenate([np.linspace(0, 2 * np.pi, 400), np.arctan2(*points.T[::-1])])
        reached = _inner(points, angles)
        rays = np.column_stack([np.cos(angles), np.sin(angles)])
        met = np.isfinite(reached)
        ends = reached[met, None] * rays[met]
        edges = ConvexHull(points).equations
        assert (ends @ edges[:, :2].T + edges[:, 2]).max() < 1e-9
        beyond = (reached[met, None] * (1 + 1e-6) + 1e-6) * rays[met]
        assert ((beyond @ edges[:, :2].T + edges[:, 2]).max(axis=1) > 0).all()


def test_one_direction_alone_is_no_polygon(cube: Problem) -> None:
    found = envelope(cube, [ACROSS], [ALONG], directions=1)
    assert found.gap == math.inf
    assert found.inner(45.0) == -math.inf
    assert isinstance(found, Envelope)


def test_constant_loads_are_not_multiplied(cube: Problem) -> None:
    with pytest.raises(InputError, match="is constant, but an envelope multiplies it"):
        envelope(cube, [Traction("z1", (0.0, 0.0, 1.0), constant=True)], [ACROSS])
