"""Test interaction diagrams: exact sets between two proven polygons."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from perfplast_fenicsx import Force, InputError, Pressure, Problem, Support, Traction, VonMises
from perfplast_fenicsx.limit_analysis import BodyBounds, Envelope, Proven, envelope
from perfplast_fenicsx.limit_analysis.body.interaction import Angles, Progress, Proving
from perfplast_fenicsx.limit_analysis.body.proven_polytopes import (
    farthest_apart,
    inner_along,
    outer_along,
    rays_at,
    spread,
    to_begin_with,
)
from perfplast_fenicsx.mesh.sample_meshes import Box, Surface, structured_mesh
from perfplast_fenicsx.pictures.envelope_picture import save_envelope
from perfplast_fenicsx.problem.declared.loads import Load
from tests.limit_analysis.test_rigid_bounds import PRANDTL, footing
from tests.limit_analysis.test_static_bound import rectangle

Y = 300.0
STEEL = VonMises(2e5, 0.3, Y)
ACROSS = Pressure("x1", -1.0)
ALONG, IN_SHEET = Traction("z1", (0.0, 0.0, 1.0)), Traction("y1", (0.0, 1.0))


@pytest.fixture
def cube(comm: MPI.Intracomm) -> Problem:
    """Return an eighth of a cube that is pulled in two directions: von Mises' ellipse."""
    surfaces = [
        Surface(f"{axis}{end}", ("cube",), lambda x, i=i, end=end: x[i] == end)
        for i, axis in enumerate("xyz")
        for end in (0, 1)
    ]
    mesh = structured_mesh(comm, [Box("cube", (0, 0, 0), (1, 1, 1), (1, 1, 1))], surfaces)
    held = [Support(f"{axis}0", axis) for axis in "xyz"]
    return Problem(mesh, {"cube": STEEL}, held, [ALONG], degree=2)


@pytest.fixture
def sheet(comm: MPI.Intracomm) -> Problem:
    """A quarter of a square sheet that is pulled in two directions: the same ellipse."""
    surfaces = {
        f"{axis}{end}": lambda x, i=i, end=end: np.abs(x[i] - end) < 1e-9
        for i, axis in enumerate("xy")
        for end in (0, 1)
    }
    mesh = rectangle((1, 1), (1.0, 1.0), {"sheet": lambda x: x[0] < 2}, surfaces, comm=comm)
    held = [Support(f"{axis}0", axis) for axis in "xy"]
    return Problem(mesh.thin(), {"sheet": STEEL}, held, [IN_SHEET], degree=2)


def ellipse(angle: float) -> float:
    """Return the distance at which the ray leaves a² − ab + b² ≤ Y²."""
    a, b = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    return Y / math.sqrt(a * a - a * b + b * b)


def angles_of(found: Envelope) -> list[float]:
    return [angle for (angle,) in found.directions]


def is_around(found: Envelope, exact: Callable[[float], float], last: float) -> None:
    """An exact set is between the polygons of all rays up to one."""
    for angle in [*np.arange(0.0, last + 0.25, 0.5), *angles_of(found)]:
        angle = float(angle)
        assert found.inner(angle) <= exact(angle) * (1 + 1e-9)
        assert found.outer(angle) >= exact(angle) * (1 - 1e-9)


def is_closed(found: Envelope) -> None:
    """Both polygons end all around, and each pair that is carried is within every half-plane."""
    assert all(found.signed)
    assert math.isfinite(found.gap)
    for angle in np.arange(0.0, 360.0, 1.0).tolist():
        assert 0 < found.inner(angle) <= found.outer(angle) < math.inf
    beyond = found.carried @ found.sides[:, :2].T - found.sides[:, 2]
    assert (beyond <= 1e-9 * np.abs(found.sides[:, 2])).all()


def fits_the_ellipse(
    problem: Problem, along: Load, around: bool, until: float, path: Path
) -> Envelope:
    """An envelope that ends by itself with von Mises' ellipse between its polygons. Collective."""
    told, most, last = list[Proven](), 60 if around else 20, 360 if around else 90

    def listen(angles: Angles, low: BodyBounds, high: BodyBounds, prove: Proving) -> Proven:
        told.append(prove(low, high))
        assert told[-1].angles == angles
        return told[-1]

    found = envelope(
        problem,
        [[ACROSS], [along]],
        directions=most,
        until=until,
        around=around,
        progress=Progress(listen),
    )
    assert tuple(one.angles for one in told) == found.directions
    assert len(told) < most
    assert found.gap <= until
    is_around(found, ellipse, last)
    for angle in [*np.arange(0.0, last + 0.5, 0.5), *angles_of(found)]:
        assert found.outer(angle) / found.inner(angle) <= (1 + until) * (1 + 1e-4)
    table = found.rows()
    assert len(table) == last + 1
    assert table[45]["carried"] == pytest.approx(found.inner(45.0), rel=1e-12)
    save_envelope(table, ("a", "b"), "A cube", path)
    assert path.stat().st_size > 10_000
    return found


@pytest.mark.long
@pytest.mark.mpi2
def test_an_ellipse_is_between_the_polygons(sheet: Problem, tmp_path: Path) -> None:
    is_closed(fits_the_ellipse(sheet, IN_SHEET, True, 0.1, tmp_path / "envelope.png"))


@pytest.mark.long(but=["False-0.1"])
@pytest.mark.serial
@pytest.mark.parametrize(("around", "until"), [(False, 0.1), (False, 0.01), (True, 0.01)])
def test_an_ellipse_of_a_cube(around: bool, until: float, cube: Problem, tmp_path: Path) -> None:
    fits_the_ellipse(cube, ALONG, around, until, tmp_path / "envelope.png")


@pytest.mark.mpi2
def test_loads_that_stay(cube: Problem) -> None:
    """A pull that stays moves the set, and what is carried without any load is not known."""
    mesh, dead = cube.tagged_mesh, 100.0
    stays = Traction("z1", (0.0, 0.0, dead), constant=True)
    held = cube.given.supports
    problem = Problem(mesh, {"cube": STEEL}, held, [stays, ACROSS], degree=2)
    found = envelope(problem, [[ACROSS], [ALONG]], directions=6, until=0.02)
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
        reached = inner_along(points, rays_at(np.degrees(angles)[:, None]))
        rays = np.column_stack([np.cos(angles), np.sin(angles)])
        met = np.isfinite(reached)
        ends = reached[met, None] * rays[met]
        edges = ConvexHull(points).equations
        assert (ends @ edges[:, :2].T + edges[:, 2]).max() < 1e-9
        beyond = (reached[met, None] * (1 + 1e-6) + 1e-6) * rays[met]
        assert ((beyond @ edges[:, :2].T + edges[:, 2]).max(axis=1) > 0).all()


@pytest.mark.serial
@pytest.mark.parametrize("signed", [(False, False, False), (False, True, True), (True, True, True)])
def test_an_octahedron(signed: tuple[bool, ...]) -> None:
    """|a| + |b| + |c| ≤ 1 by its corners and faces, along rays in its faces' edges as well."""
    angles = spread(signed, 5.0)
    rays = rays_at(angles)
    for axis, two in zip(rays.T, signed, strict=True):
        assert (axis.min() < -0.99) == two
        assert axis.min() > (-1.01 if two else -1e-12)
    corners = np.array([s * row for row in np.eye(3) for s in (1.0, -1.0)] + [[0.0, 0.0, 0.0]])
    allowed = corners[(corners > -0.5).all(axis=1) | np.array(signed)[np.argmax(abs(corners), 1)]]
    faces = np.array([(x, y, z, 1.0) for x in (1, -1) for y in (1, -1) for z in (1, -1)])
    sides = faces / np.sqrt(3)
    exact = 1 / np.abs(rays).sum(axis=1)
    np.testing.assert_allclose(inner_along(allowed, rays), exact, rtol=1e-9)
    np.testing.assert_allclose(outer_along(sides, rays), exact, rtol=1e-9)
    first = to_begin_with(signed)
    assert len(first) == 3 + sum(signed) + 2 ** sum(signed)
    gap, worst = farthest_apart(allowed, sides, signed, first)
    assert gap == pytest.approx(0.0, abs=1e-9)
    gap, worst = farthest_apart(allowed / 2, sides, signed, first)
    assert gap == pytest.approx(1.0, rel=1e-9)
    assert worst is not None
    assert (rays_at(first) @ rays_at(worst[None])[0]).max() < math.cos(math.radians(0.9))


@pytest.mark.long(but=["around0-1"])
@pytest.mark.parametrize(("around", "parts"), [((False, False), 1), ((True, False), 2)])
def test_numbers_of_either_sign(around: tuple[bool, bool], parts: int, cube: Problem) -> None:
    """A quarter or half of the ellipse, and what is refused."""
    with pytest.raises(InputError, match="one entry for each of the 3"):
        envelope(cube, [[ACROSS], [ALONG], [ALONG]], around=around)
    with pytest.raises(InputError, match="envelope needs two or three"):
        envelope(cube, [[ACROSS]])
    found = envelope(cube, [[ACROSS], [ALONG]], directions=4 + parts, around=around)
    turns = [row["angle"] for row in found.rows()]
    assert (turns[0], turns[-1]) == (0.0, 90.0 * parts)
    is_around(found, ellipse, 90.0 * parts)


def test_one_direction_alone_is_no_polygon(cube: Problem) -> None:
    found = envelope(cube, [[ACROSS], [ALONG]], directions=1)
    assert found.gap == math.inf
    assert abs(found.inner(45.0)) < 1e-12  # nothing is carried without a load, and no more known
    assert isinstance(found, Envelope)


def test_constant_loads_are_not_multiplied(cube: Problem) -> None:
    with pytest.raises(InputError, match="is constant, but an envelope"):
        envelope(cube, [[Traction("z1", (0.0, 0.0, 1.0), constant=True)], [ACROSS]])


def green(angle: float) -> float:
    """Return the distance at which a ray of V and H leaves the set that a rough strip carries.

    For the width 1 and k = 1, V = 1 + π − arcsin H + √(1 − H²) up to H = 1 (A. P. Green, J. Mech.
    Phys. Solids 2, 1954), by bisection.
    """
    v, h = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    low, high = 0.0, min(PRANDTL / max(v, 1e-12), 1 / max(h, 1e-12))
    while high - low > 1e-12 * high:
        middle = (low + high) / 2
        lean = min(middle * h, 1.0)
        within = middle * v <= 1 + math.pi - math.asin(lean) + math.sqrt(1 - lean**2)
        low, high = (middle, high) if within else (low, middle)
    return low


PUSH = Force("strip", (0.0, -1.0), point=(2.0, 1.0))
SHOVE = Force("strip", (1.0, 0.0), point=(2.0, 1.0))
TURN = Force("strip", (), 0.2, point=(2.0, 1.0))


@pytest.mark.long
def test_forces_on_a_rigid_footing() -> None:
    found = envelope(footing(PUSH), [[PUSH], [SHOVE]], directions=5, until=0.01)
    is_around(found, green, 90.0)
    assert len(found.carried) - 1 == len(found.sides) == 5  # and zero
    assert found.gap < 0.6  # of 256 cells


@pytest.mark.long(but=["True"])
@pytest.mark.parametrize("beside", [False, True])
def test_forces_and_moments_on_a_rigid_footing(beside: bool) -> None:
    """V and M, or H and M with constant V: closed diagrams, and equal gaps for mirrored loads."""
    if beside:
        stays = replace(PUSH, value=(0.0, -2.0), constant=True)
        found = envelope(footing(SHOVE, stays), [[SHOVE], [TURN]], 6, around=True)
        mirrored = 180.0
    else:
        found = envelope(footing(PUSH), [[PUSH], [TURN]], 6, around=True)
        mirrored = 0.0
    is_closed(found)
    for angle in np.arange(0.0, 360.0, 5.0).tolist():
        assert found.inner(angle) <= found.outer(mirrored + (angle if beside else -angle))


@pytest.mark.long
def test_forces_and_a_moment_on_a_rigid_footing(tmp_path: Path) -> None:
    """V, H and M: Green's curve at M = 0, and mirrored loads have equal gaps."""
    given = [[PUSH], [SHOVE], [TURN]]
    found = envelope(footing(PUSH), given, 9, around=(False, True, True))
    assert math.isfinite(found.gap)
    beyond = found.carried @ found.sides[:, :3].T - found.sides[:, 3]
    assert (beyond <= 1e-9 * np.abs(found.sides[:, 3])).all()
    for angle in np.arange(0.0, 91.0, 10.0).tolist():
        for rise in (-60.0, -30.0, 0.0, 30.0, 60.0):
            assert 0 < found.inner(angle, rise) <= found.outer(-angle, -rise) < math.inf
        assert found.inner(angle, 0.0) <= green(angle) * (1 + 1e-9)
        assert found.outer(angle, 0.0) >= green(angle) * (1 - 1e-9)
    assert "All triples inside one polytope" in found.in_words()
    save_envelope(found.rows(), ("V", "H", "M"), "A footing", tmp_path / "envelope.png", True)
    assert (tmp_path / "envelope.png").stat().st_size > 10_000
