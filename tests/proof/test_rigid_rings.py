"""Test that proofs of rigid plates on bodies of revolution pass, and forgeries are refused."""

import re
from pathlib import Path

from mpi4py import MPI

import pytest

from perfplast_fenicsx.limit_analysis import limit_bounds
from perfplast_fenicsx.proof import check
from tests.limit_analysis.test_rigid_rings import pressed_disc
from tests.proof.forging import (
    Arrays,
    Forgery,
    Halves,
    both,
    high,
    in_turn,
    low,
    put,
    said_of_forged,
    times,
    written,
)

pytestmark = pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="the checker is serial")


@pytest.fixture(scope="module")
def honest(tmp_path_factory: pytest.TempPathFactory) -> Halves:
    """Return the halves of a proof of a disc between a floor and a plate."""
    path, bounds = tmp_path_factory.mktemp("honest"), limit_bounds(pressed_disc(2))
    found = written(path, bounds)
    proven = check(path / "bounds.h5")
    assert proven["lower"].proven == pytest.approx(bounds.lower.value, rel=1e-9)
    assert proven["upper"].proven == pytest.approx(bounds.upper.value, rel=1e-9)
    assert "(held in x, without rotation)" in proven["lower"].words[0]
    return found


def bent(them: Arrays) -> None:
    """Increase the velocity of the plate at its edge."""
    r = them["vertices"][them["cells"], 0]
    on = (them["vertices"][them["cells"], 1] > 0.5 - 1e-9) & (r > 1 - 1e-9)
    them["velocity"][them["nodes"][:, :3][on]] *= 1 + 1e-6


RIGID: dict[str, tuple[Forgery, str]] = {
    "more force than it has": (low(times("rigid_force", 1.1)), "rigid forces"),
    "half the force above": (high(in_turn(times("rigid_force", 0.5), times("bound", 2))), "loads"),
    "free to turn": (both(put("rigid_held", (0, 0), 0)), "in a direction other than the axis"),
    "held along the axis": (
        both(put("rigid_held", (0, 1), 1)),
        "in a direction other than the axis",
    ),
    "a plate that bends": (high(bent), "only"),
    "half the bound": (high(times("bound", 0.5)), "only|above"),
    "twice the bound": (low(times("bound", 2.0)), "rigid forces"),
}


@pytest.mark.parametrize("name", RIGID)
def test_a_forged_plate(honest: Halves, tmp_path: Path, name: str) -> None:
    forge, why = RIGID[name]
    said = said_of_forged(honest, forge, tmp_path)
    assert re.search(why, said), said
