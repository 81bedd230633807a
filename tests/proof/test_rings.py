"""Test that proofs of bodies of revolution have no faults, and that forgeries are refused."""

from collections.abc import Callable
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx import (
    BodyForce,
    Contact,
    DruckerPrager,
    MohrCoulomb,
    Plane,
    Pressure,
    Problem,
    Traction,
    limit_bounds,
)
from perfplast_fenicsx.materials import Material
from perfplast_fenicsx.proof import check
from perfplast_fenicsx.proof.checker import check_lower, check_upper
from perfplast_fenicsx.proof.rings import ENDS, over_radius
from tests.contact.blocks_apart import blocks_apart
from tests.models import STEEL
from tests.proof.forging import (
    Arrays,
    Forgery,
    Halves,
    both,
    high,
    low,
    said_of_forged,
    times,
    written,
)

pytestmark = pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="the checker is serial")


SOIL = MohrCoulomb(young=1e3, poisson=0.3, cohesion=1.0, friction_angle=20.0)


def discs(law: Material = STEEL, **friction: float) -> Problem:
    """Return two stacked discs on a plane, with weight, under pressure and radial tension."""
    return Problem(
        blocks_apart(MPI.COMM_WORLD, [3, 2], [3, 2], moved_by=0.0).turned(),
        {"lower": law, "upper": law},
        [],
        [Pressure("top", 1.0), Traction("top", [0.05, 0.0]), BodyForce("upper", [0.0, -0.1])],
        [Contact("lower_top", "upper_bottom", **friction)],  # type: ignore[arg-type]
        [Plane("bottom", [0.0, 0.0], [0.0, 1.0], name="floor", **friction)],  # type: ignore[arg-type]
        degree=2,
    )


def proven(path: Path, problem: Problem) -> Halves:
    """Return the halves of a proof of the reported bounds."""
    bounds = limit_bounds(problem, 1e-3)
    halves = written(path, bounds)
    found = check(path / "bounds.h5")
    assert found["upper"].proven == pytest.approx(bounds.upper.value, rel=1e-3)
    assert found["lower"].proven == pytest.approx(bounds.lower.value, rel=1e-9)
    assert "sections of rings" in found["lower"].words[0]
    return halves


@pytest.fixture(scope="module")
def honest(tmp_path_factory: pytest.TempPathFactory) -> Halves:
    return proven(tmp_path_factory.mktemp("rings"), discs())


def test_proofs_with_friction(tmp_path: Path) -> None:
    proven(tmp_path, discs(tresca=20.0))


@pytest.fixture(scope="module")
def of_soil(tmp_path_factory: pytest.TempPathFactory) -> Halves:
    return proven(tmp_path_factory.mktemp("soil"), discs(SOIL, coulomb=0.2))


def test_proofs_of_round_cones(tmp_path: Path) -> None:
    soil = DruckerPrager(
        young=1e3, poisson=0.3, cohesion=1.0, friction_angle=20.0, match="compression"
    )
    proven(tmp_path, discs(soil))


def test_resultants_are_those_of_the_full_turn(honest: Halves) -> None:
    words = check_lower(honest["lower"]).words[0]
    radius = honest["lower"]["vertices"][:, 0].max()
    assert f"{-np.pi * radius**2:.6g}) on surface" in words


def moved(by: float) -> Callable[[Arrays], None]:
    """Move all bodies away from the axis, or across it."""
    return lambda them: them.update(vertices=them["vertices"] + [by, 0.0])


def pressed_on_the_axis(them: Arrays) -> None:
    """Add a hydrostatic S at the axis, which does not affect yield."""
    x = them["vertices"][them["cells"]][..., 0]
    them["stress"][:, :3][x == 0] += np.eye(2)


def moving_on_the_axis(them: Arrays) -> None:
    """Add an unbounded axial velocity at the axis."""
    x = np.zeros(len(them["velocity"]))
    x[them["nodes"][:, :3]] = them["vertices"][them["cells"]][..., 0]
    x[them["nodes"][:, 3:]] = them["vertices"][them["cells"]][:, ENDS][..., 0].mean(axis=2)
    them["velocity"][x == 0, 1] += 1e-3


def between_vertices(them: Arrays) -> None:
    """Add a stress that exceeds yield only at the middles of edges."""
    them["stress"][0, 3:, 0, 1] += 1e3
    them["stress"][0, 3:, 1, 0] += 1e3


def plane(them: Arrays) -> None:
    them.update(revolved=np.zeros((), dtype=np.uint8))


def rigid_surface(them: Arrays) -> None:
    """Add a plate on the loaded surface."""
    them["rigid"] = them["surface"].max(keepdims=True)
    them["rigid_held"] = np.zeros((1, 2), dtype=np.uint8)
    for kind in ("", "constant_", "any_"):
        them[f"{kind}rigid_force"] = np.zeros((1, 2))
        them[f"{kind}rigid_moment"] = np.zeros((1, 1))


def pores_that_cancel(them: Arrays) -> None:
    """Add growing and constant pore pressures that cancel each other."""
    them["pore_pressure"] = np.ones(them["cells"].shape)
    them["constant_pore_pressure"] = -them["pore_pressure"]


FORGERIES: dict[str, tuple[Forgery, str]] = {
    "a larger lower bound": (low(times("bound", 1.01)), "outer tractions|left of load"),
    "a larger stress": (low(lambda it: [times(n, 1.01)(it) for n in ("stress", "bound")]), "large"),
    "a smaller upper bound": (high(times("bound", 0.9)), "only"),
    "stress on the axis": (low(pressed_on_the_axis), "axis"),
    "stress between vertices": (low(between_vertices), "equilibrium|inner tractions"),
    "velocity on the axis": (high(moving_on_the_axis), "only"),
    "lower half farther out": (low(moved(1.0)), "equilibrium|outer tractions|different"),
    "upper half farther out": (high(moved(1.0)), "different"),
    "across the axis": (both(moved(-0.5)), "negative radii"),
    "plane all at once": (both(plane), "the shape of|does not fit"),
    "one half plane": (high(plane), "the shape of|revolution"),
    "flag of two": (both(lambda it: it.update(revolved=np.ones(2, dtype=np.uint8))), "revolved"),
    "no flag": (both(lambda it: it.pop("revolved")), "the shape of|does not fit"),
    "cones of the plane": (
        both(lambda it: it.update(cone_slope=it["cone_slope"][:, :3])),
        "the shape of",
    ),
    "stress at vertices alone": (
        low(lambda it: it.update(stress=it["stress"][:, :3])),
        "does not fit",
    ),
    "a stronger lower half": (low(times("cone_bound", 2.0)), "weaker"),
    "a rigid surface that turns": (both(rigid_surface), "in a direction other than the axis"),
    "pores that cancel": (both(pores_that_cancel), "pore|pressure"),
    "volume that changes": (high(lambda it: swell(it)), "exceed the work"),
    "cones without a bound": (both(lambda it: loosen(it)), "no bound"),
    "no weight": (low(times("body_force", 0.0)), "equilibrium|different"),
    "a twist of the stress": (
        low(lambda it: it["stress"].__setitem__((0, 0, 0, 1), 7.0)),
        "asymmetry",
    ),
}


def loosen(them: Arrays) -> None:
    """Use sand, with yield ratios of S instead of S over r."""
    normal = [1.0, 1.0, 1.0, 0.0]
    slopes = np.tile(normal, (len(them["cone_bound"]), 1))
    them.update(cone_bound=0.0 * them["cone_bound"], cone_slope=slopes)


def swell(them: Arrays) -> None:
    """Let U_r increase with the distance from the axis."""
    x = np.zeros(len(them["velocity"]))
    x[them["nodes"][:, :3]] = them["vertices"][them["cells"]][..., 0]
    x[them["nodes"][:, 3:]] = them["vertices"][them["cells"]][:, ENDS][..., 0].mean(axis=2)
    them["velocity"][:, 0] += x**2 * np.abs(them["velocity"]).max()


def shrink(them: Arrays) -> None:
    """Let −U_r increase with the distance from the axis."""
    them["velocity"][:] *= -1.0
    swell(them)
    them["velocity"][:] *= -1.0


FORGERIES_OF_SOIL: dict[str, tuple[Forgery, str]] = {
    "a volume that grows too little": (high(shrink), "dilate too little"),
    "an angle of friction that is larger": (high(times("cone_sine", 1.2)), "dilate too little"),
    "an angle of friction that is smaller": (low(times("cone_sine", 0.8)), "weaker|cones"),
    "a smaller upper bound": (high(times("bound", 0.9)), "only"),
    "a larger lower bound": (low(times("bound", 1.01)), "outer tractions|left of load"),
}


@pytest.mark.parametrize("forgery", FORGERIES_OF_SOIL)
def test_forgeries_of_ground_that_dilates(of_soil: Halves, forgery: str, tmp_path: Path) -> None:
    forge, word = FORGERIES_OF_SOIL[forgery]
    said = said_of_forged(of_soil, forge, tmp_path)
    assert any(part in said for part in word.split("|")), said


@pytest.mark.parametrize("forgery", FORGERIES)
def test_forgeries(honest: Halves, forgery: str, tmp_path: Path) -> None:
    forge, word = FORGERIES[forgery]
    said = said_of_forged(honest, forge, tmp_path)
    assert any(part in said for part in word.split("|")), said


def test_halves_alone(honest: Halves) -> None:
    assert not check_lower(honest["lower"]).faults
    assert not check_upper(honest["upper"]).faults


@pytest.mark.parametrize("radii", [(0.3, 0.5, 1.1), (0.0, 0.5, 1.1)])
def test_integrals_over_the_radius_are_from_above(radii: tuple[float, float, float]) -> None:
    n = 400
    i, j = np.indices((n, n)).reshape(2, -1)
    places = np.column_stack([(i + 1 / 3) / n, (j + 1 / 3) / n])
    places = places[places.sum(axis=1) < 1]
    places = np.column_stack([places, 1 - places.sum(axis=1)])
    a, b = ENDS.T
    polynomials = np.hstack([places**2, 2 * places[:, a] * places[:, b]])
    exact = (polynomials / (places @ radii)[:, None]).mean(axis=0)
    found = over_radius(np.array([radii]), np.ones(1))[0]
    kept = found > 0
    assert kept.sum() == (6 if min(radii) > 0 else 5)
    assert (found[kept] >= exact[kept] * (1 - 0.02)).all()
    assert (found[kept] <= exact[kept] * 1.5).all()
