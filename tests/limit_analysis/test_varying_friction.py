"""Test strict bounds for ground whose friction angle varies in space."""

import math
from pathlib import Path

from mpi4py import MPI

import h5py
import numpy as np
import pytest

from perfplast_fenicsx import InputError, Pressure, Problem, Support
from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis import limit_bounds
from perfplast_fenicsx.limit_analysis.discrete.strength_fields import Side, steepness_of_cells
from perfplast_fenicsx.limit_analysis.discrete.strength_reduction import weakened
from perfplast_fenicsx.materials import MohrCoulomb
from perfplast_fenicsx.materials.varying_friction import (
    FrictionAngle,
    FrictionSine,
    FrictionStrength,
    divided_friction,
)
from perfplast_fenicsx.proof.body import Body
from perfplast_fenicsx.proof.checker import check_lower, check_upper
from perfplast_fenicsx.proof.halves import differences
from perfplast_fenicsx.spatial_fields import (
    DepthTable,
    Formula,
    SpatialField,
    Strength,
    read_points,
    read_vtu,
)
from tests.limit_analysis.test_linear_tractions import SQUARE, cube
from tests.limit_analysis.test_static_bound import rectangle
from tests.limit_analysis.test_strength_fields import proven, values, write_points, write_vtu

PROFILE = "30 - 8*y"
SIDES: tuple[Side, ...] = ("below", "above")


def column(
    friction: Strength, cohesion: Strength = 10.0, n: int = 2, shake: float = 0.1
) -> Problem:
    """Return the unit square on rollers under a uniform pressure."""
    halves = {"lower": lambda x: x[1] < 0.5, "upper": lambda x: x[1] > 0.5}
    mesh = rectangle((n, n), (1.0, 1.0), halves, SQUARE, shake)
    supports = [Support("left", "x"), Support("bottom", "y")]
    ground = MohrCoulomb(1e4, 0.3, cohesion, friction)
    return Problem(mesh, dict.fromkeys(halves, ground), supports, [Pressure("top", 1.0)], degree=2)


def strength(friction: float, cohesion: float = 10.0) -> float:
    """Return the uniaxial strength."""
    return 2 * cohesion * math.tan(math.radians(45 + friction / 2))


FIELDS: dict[str, tuple[Strength, SpatialField]] = {
    "formula": (7.0, Formula("20 + 15*x - 4*y")),
    "kinks": (7.0, Formula("20 + 9*abs(x - 0.4) + maximum(0, 3*y - 1)")),
    "table": (Formula("5 + 2*x"), DepthTable([(0.0, 40.0), (0.5, 12.0), (1.0, 30.0)])),
    "steep": (Formula("9 - 4*y"), Formula("3 + 80*x")),
    "constant": (7.0, Formula("25 + 0*x")),
}


@pytest.mark.parametrize("name", FIELDS)
@pytest.mark.parametrize("factor", [1.0, 1.6])
def test_a_cell_has_a_cone_inside_of_and_one_around_those_of_its_points(
    name: str, factor: float
) -> None:
    """Slope and apex bracket those of each point. Stresses of the inner cone are admissible."""
    rng = np.random.default_rng(0)
    cohesion, angle = FIELDS[name]
    friction = divided_friction(angle, factor)
    sine, bound = FrictionSine(friction), FrictionStrength(cohesion, friction)
    corners = rng.random((200, 1, 2)) * 0.8 + 0.2 * rng.random((200, 3, 2))
    shares = rng.dirichlet(np.ones(3), 40)
    points = np.einsum("pv,cvi->cpi", shares, corners).reshape(-1, 2)
    s, b = (it.at(points, "here").reshape(200, -1) for it in (sine, bound))
    slopes, bounds = (it.between(corners, "here") for it in (sine, bound))
    for steep in slopes:
        assert (steep == steep[:, :1]).all()
    least, most = (steep[:, :1] for steep in slopes)
    low, high = (of @ shares.T for of in bounds)
    little = 1e-12
    assert (least <= s + little).all() and (s <= most + little).all()
    assert (low / least <= b / s * (1 + little)).all()
    assert (high / most >= b / s * (1 - little)).all()
    assert (low > 0).all()
    p = rng.uniform(-30.0, 20.0, s.shape)
    inside, itself, around = low - 2 * least * p, b - 2 * s * p, high - 2 * most * p
    small = 1e-10
    assert (inside <= np.maximum(itself, 0.0) + small).all()
    assert (itself <= np.maximum(around, 0.0) + small).all()
    if name == "constant":
        assert np.allclose(bounds[0], bounds[1], rtol=1e-13, atol=0.0)


@pytest.mark.mpi2
def test_bounds_of_a_profile_close_in(shared_tmp_path: Path) -> None:
    """Bounds are strict on each mesh, and their distance halves with the cell size."""
    found = {
        n: proven(column(Formula(PROFILE), Formula("10 + 2*x"), n), shared_tmp_path, 1e-5, str(n))
        for n in (2, 4, 8)
    }
    low, high = np.array([values(bounds) for bounds in found.values()]).T
    assert low.max() <= high.min()
    assert strength(22.0) <= high.min()
    assert low.max() <= strength(30.0, 12.0)
    gaps = high - low
    assert gaps[1] < 0.7 * gaps[0] and gaps[2] < 0.6 * gaps[1]
    told = [words for words in found[4].taken if "smallest angle" in words]
    assert len(told) == 2 and all("friction_angle" in words for words in told)


@pytest.mark.mpi2
def test_a_constant_field_is_the_number() -> None:
    """Bounds agree, also with half the strength."""
    for factor in (1.0, 2.0):
        one, other = (
            np.array(values(limit_bounds(weakened(column(it), factor), 1e-6)))
            for it in (20.0, Formula("20 + 0*y"))
        )
        assert np.allclose(one, other, rtol=1e-10, atol=0.0)


@pytest.mark.serial
def test_writings_of_one_angle_agree(tmp_path: Path) -> None:
    """A formula, a table, points and a separate mesh give equal cones of cells, to 1e-12."""

    def linear(x: Floats) -> Floats:
        return 30 - 8 * x[:, 1]

    points = write_points(tmp_path / "points.csv", 40, 1, linear)
    mesh = write_vtu(tmp_path / "c.vtu", column(20.0, n=5), linear)
    given = [Formula(PROFILE), DepthTable([(1.0, 22.0), (0.0, 30.0)])]
    given += [read_points(points, "c"), read_vtu(mesh, "c")]
    corners = np.random.default_rng(2).random((100, 3, 2)) * 0.9 + 0.05
    for field in (FrictionSine, lambda friction: FrictionStrength(5.0, friction)):
        first, *others = (field(FrictionAngle(it)).between(corners, "here") for it in given)
        for one in others:
            assert np.allclose(one, first, rtol=1e-12, atol=0.0)
    for side in SIDES:
        steep = [steepness_of_cells(column(it), side) for it in given]
        assert steep[0] is not None
        for factors in steep[1:]:
            assert factors is not None
            assert np.allclose(factors, steep[0], rtol=1e-12, atol=0.0)


@pytest.mark.mpi2
def test_ground_without_cohesion(shared_tmp_path: Path) -> None:
    """Sand carries the pressure that acts at its side, too."""
    problem = column(Formula(PROFILE), 0.0)
    loads = [Pressure("top", 1.0), Pressure("right", 1.0, constant=True)]
    given = problem.given
    sand = Problem(problem.tagged_mesh, given.materials, given.supports, loads, degree=2)
    low, high = values(proven(sand, shared_tmp_path, 1e-5))
    n = [math.tan(math.radians(45 + phi / 2)) ** 2 for phi in (22.0, 30.0)]
    assert 0.7 * n[0] <= low <= high <= 1.3 * n[1]
    assert low <= n[1] and high >= n[0]


@pytest.mark.serial
def test_the_checker_judges_slopes_of_cells(shared_tmp_path: Path) -> None:
    """It refuses stresses in flatter cones, mechanisms in steeper ones, and a weaker upper half."""
    proven(column(Formula(PROFILE)), shared_tmp_path)
    with h5py.File(shared_tmp_path / "bounds.h5") as file:
        halves = {
            kind: {name: np.asarray(data) for name, data in file[kind].items()}
            | {"bound": np.asarray(file[kind].attrs["bound"])}
            for kind in ("lower", "upper")
        }
    lower, upper = halves["lower"], halves["upper"]
    assert len(lower["cone_slope"]) > 4
    flatter = {**lower, "cone_slope": 0.99 * lower["cone_slope"]}
    steeper = {**upper, "cone_slope": 1.01 * upper["cone_slope"]}
    assert not check_lower(lower).faults and not check_upper(upper).faults
    assert check_lower(flatter).faults and check_upper(steeper).faults
    one, other = (Body.of(half) for half in (lower, upper))
    assert not differences(one, other)
    assert differences(other, one)


@pytest.mark.parametrize(
    ("angle", "words"),
    [
        (Formula("30 - 40*x"), r"friction_angle, 30 - 40\*x, is -10 degrees at \(1, "),
        (Formula("60 + 40*x"), r"is 100 degrees at \(1, "),
        (Formula("30*abs(y - 0.31) + 1e-3"), r"so steeply in the cell at \("),
        (DepthTable([(0.0, 20.0), (0.7, 30.0)]), r"covers 0 to 0.7.*material at \("),
        (Formula("10 + sqrt(y)"), "linear functions below and above"),
    ],
)
def test_angles_that_are_refused(angle: SpatialField, words: str) -> None:
    with pytest.raises(InputError, match=words):
        limit_bounds(column(angle))


def test_what_an_angle_that_varies_does_not_go_with() -> None:
    angle = Formula(PROFILE)
    for given in (
        {"dilatancy_angle": 5.0},
        {"nonassociated": "davis-a"},
        {"tensile_strength": 1.0},
    ):
        with pytest.raises(InputError, match=f"{next(iter(given))} = .* varies in space"):
            MohrCoulomb(1e4, 0.3, 10.0, angle, **given)
    supports = [Support(f"{axis}0", axis) for axis in "xyz"]
    ground = {"block": MohrCoulomb(1e4, 0.3, 10.0, Formula("30 - 8*z"))}
    with pytest.raises(InputError, match="only in plane strain"):
        limit_bounds(Problem(cube(1), ground, supports, [Pressure("z1", 1.0)], degree=2))


def test_levels_take_the_angle_at_points(comm: MPI.Intracomm) -> None:
    """At each point of the mesh, the law has the sine of this point."""
    problem = column(Formula(PROFILE), n=2)
    sine = next(on.numbers["sine"] for on in problem.laws)
    angles = np.degrees(np.arcsin(sine.x.array))
    assert 22.0 < comm.allreduce(float(angles.min()), MPI.MIN) < 23.0
    assert 29.0 < comm.allreduce(float(angles.max()), MPI.MAX) < 30.0
