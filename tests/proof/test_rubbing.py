"""Test that proofs of bodies with friction have no faults, and that forgeries are refused."""

import copy
from collections.abc import Callable
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx import (
    Contact,
    Plane,
    Pressure,
    Problem,
    Support,
    Traction,
    limit_bounds,
)
from perfplast_fenicsx.proof import check
from perfplast_fenicsx.proof.checker import DRUCKER
from tests.contact.blocks_apart import blocks_apart
from tests.models import STEEL
from tests.proof.forging import Halves, said_of, said_of_forged, write, written

pytestmark = pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="the checker is serial")


def stacked(gdim: int, **friction: float) -> Problem:
    """Return two blocks on a plane, with friction everywhere."""
    down = [0.0] * (gdim - 1)
    return Problem(
        blocks_apart(MPI.COMM_WORLD, [3] * gdim, [3] * gdim, moved_by=0.0),
        {"lower": STEEL, "upper": STEEL},
        [Support("x0", "x")],
        [Pressure("top", 1.0), Traction("top", [0.05, *down])],
        [Contact("lower_top", "upper_bottom", **friction)],  # type: ignore[arg-type]
        [Plane("bottom", [*down, 0.0], [*down, 1.0], name="floor", **friction)],  # type: ignore[arg-type]
        degree=2,
    )


def proven(path: Path, problem: Problem) -> Halves:
    """Return the halves of a proof of the reported bounds."""
    bounds = limit_bounds(problem, 1e-3)
    halves = written(path, bounds)
    found = check(path / "bounds.h5")
    assert found["upper"].proven == pytest.approx(bounds.upper.value, rel=1e-3)
    assert found["lower"].proven == pytest.approx(bounds.lower.value, rel=1e-9)
    return halves


@pytest.fixture(scope="module", params=[2, 3])
def honest(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Halves:
    """Return the halves of a proof with Tresca friction."""
    folder = tmp_path_factory.mktemp("rubbing")
    return proven(folder, stacked(request.param, tresca=10.0))


def times(kind: str, name: str, factor: float) -> Callable[[Halves], None]:
    """Return a function that multiplies an array of a half."""
    return lambda halves: halves[kind].update({name: halves[kind][name] * factor})


def both(name: str, factor: float) -> Callable[[Halves], None]:
    """Return a function that multiplies an array in both halves."""
    return lambda halves: [times(kind, name, factor)(halves) for kind in halves] and None


def more_shear(halves: Halves) -> None:
    """Add a shear in equilibrium, except for the limits of loads and contact."""
    halves["lower"]["stress"][..., 0, -1] += 1.0
    halves["lower"]["stress"][..., -1, 0] += 1.0


def slips(halves: Halves) -> None:
    """Declare friction in the upper half where slip does not open the joint."""
    for half in halves.values():
        half["contact_friction"] = np.full_like(half["contact_friction"], 0.5)


def alone(kind: str, change: Callable[[Halves], None]) -> Callable[[Halves], None]:
    """Remove the other half, which prevents a comparison."""

    def forge(halves: Halves) -> None:
        change(halves)
        del halves["upper" if kind == "lower" else "lower"]

    return forge


FORGERIES = {
    "less adhesion, contact": (both("contact_adhesion", 0.5), "shear tractions of contact are"),
    "less adhesion, plane": (both("obstacle_adhesion", 1e-6), "shear tractions of contact are"),
    "none": (alone("lower", times("lower", "contact_adhesion", 0.0)), "tractions"),
    "more adhesion above": (times("upper", "contact_adhesion", 2.0), "only"),
    "less adhesion above": (times("upper", "contact_adhesion", 0.5), "has less friction"),
    "less on the plane above": (times("upper", "obstacle_adhesion", 0.5), "has less friction"),
    "negative": (both("contact_adhesion", -1.0), "contact_adhesion is negative"),
    "infinite": (both("obstacle_adhesion", np.inf), "obstacle_adhesion is negative or not finite"),
    "no number": (both("contact_friction", np.nan), "contact_friction is negative or not finite"),
    "more shear": (alone("lower", more_shear), "tractions"),
    "friction without parting": (alone("upper", slips), "no work"),
    "too few": (
        lambda halves: halves["lower"].update(contact_adhesion=np.zeros(0)),
        "contact_adhesion",
    ),
    "upper bound lowered": (times("upper", "bound", 0.99), "only"),
    "lower bound raised": (times("lower", "bound", 1.001), "tractions"),
}


@pytest.mark.parametrize("name", FORGERIES)
def test_forgeries_are_refused(honest: Halves, name: str, tmp_path: Path) -> None:
    forge, why = FORGERIES[name]
    said = said_of_forged(honest, forge, tmp_path)
    assert why in said, said


def test_files_without_friction_have_none(honest: Halves, tmp_path: Path) -> None:
    """Missing friction counts as zero: shear is then a fault, and slip dissipates nothing."""
    halves = copy.deepcopy(honest)
    for half in halves.values():
        for name in [name for name in half if "adhesion" in name or "friction" in name]:
            del half[name]
    assert "outer tractions" in said_of(write(tmp_path / "old.h5", halves))


def test_druckers_pair_is_told(tmp_path: Path) -> None:
    halves = proven(tmp_path, stacked(2, coulomb=0.1, tresca=10.0))
    assert not halves["lower"]["contact_friction"].any()
    assert halves["upper"]["contact_friction"].all()
    found = check(tmp_path / "bounds.h5")
    assert DRUCKER in found["lower"].words[-1]
    assert "10 and 0.1 times the pressure" in found["upper"].words[0]
    halves["upper"]["contact_friction"] *= 1.05
    assert "only" in said_of(write(tmp_path / "forged.h5", halves))
