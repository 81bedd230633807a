"""Test that forged rigid surfaces are refused, in honest proofs of pushed and rotated plates."""

import re
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx import (
    Force,
    Problem,
    RigidSurface,
    Support,
    VonMises,
    read_gmsh,
)
from perfplast_fenicsx.limit_analysis import limit_bounds
from perfplast_fenicsx.proof import check
from tests.proof.forging import (
    Arrays,
    Forgery,
    Halves,
    alone,
    both,
    drop,
    high,
    in_turn,
    low,
    make,
    put,
    said_of_forged,
    times,
    written,
)
from tests.proof.test_forgeries import free_cell
from tests.random_bodies import Stack, write_stack

pytestmark = pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="the checker is serial")


@pytest.fixture(scope="module", params=[2, 3])
def honest(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Halves:
    """Return the halves of a proof of a block on a plane, with a laterally loaded plate on top."""
    dim, path = request.param, tmp_path_factory.mktemp("honest")
    it = Stack(1, dim, (0.7,), ((1.0, 1.0),), 0.4 if dim == 2 else 0.7, plain=True)
    write_stack(path / "stack.msh", it)
    turn = 0.05 if dim == 2 else (0.0, 0.05, 0.0)
    aside = [0.2] + [0.0] * (dim - 2)
    problem = Problem(
        read_gmsh(MPI.COMM_WORLD, path / "stack.msh"),
        {"block0": VonMises(young=1e3, poisson=0.3, yield_stress=1.0)},
        [Support("bottom"), RigidSurface("top")],
        [Force("top", [*aside, -1.0], turn, point=[0.4] * dim)],
        degree=2,
    )
    found = written(path, limit_bounds(problem))
    assert "rigid plates glued to surface" in check(path / "bounds.h5")["lower"].words[0]
    return found


def bent(them: Arrays) -> None:
    """Move one node of the plate."""
    d = them["vertices"].shape[1]
    cells, nodes = them["cells"], them["nodes"]
    tag = them["rigid"][0]
    vertex = them["facets"][them["surface"] == tag][0, 0]
    node = nodes[:, : d + 1][cells == vertex][0]
    them["velocity"][node] *= 1 + 1e-6


def without_plate(them: Arrays) -> None:
    """Remove the rigid surface and its loads."""
    for name in ("rigid", "rigid_held", "rigid_force", "rigid_moment"):
        del them[name]


def pushed_for_nothing(them: Arrays) -> None:
    """Remove the stress under the plate, in a body of any strength, beside a more loaded body."""
    them["cone_bound"] = 1e15 * them["cone_bound"]
    them["stress"] = 0.0 * them["stress"]
    free_cell(1e15, pressed=1e12)(them)


RIGID: dict[str, tuple[Forgery, str]] = {
    "no plate at all": (both(without_plate), "only supports are loaded"),
    "no loads of the plate": (
        alone("lower", in_turn(drop("rigid_force"), drop("rigid_moment"))),
        "loaded",
    ),
    "more force than it has": (low(times("rigid_force", 1.1)), "rigid forces"),
    "another moment": (low(times("rigid_moment", 1.1)), "rigid forces"),
    "another moment above": (high(in_turn(times("rigid_moment", 0.5), times("bound", 4))), "loads"),
    "held, so that nothing counts": (
        low(make("rigid_held", np.ones_like)),
        "only supports are loaded",
    ),
    "held above": (high(make("rigid_held", np.ones_like)), "only supports are loaded"),
    "held along one axis above": (high(put("rigid_held", (0, 0), 1)), "no work|rigid"),
    "another tag above": (high(put("surface", 0, 77)), "different surfaces"),
    "all tags others above": (
        high(lambda them: them.update({n: them[n] + 5 for n in ("surface", "rigid")})),
        "different surfaces",
    ),
    "a plate that bends": (high(bent), "only"),
    "a surface that there is not": (both(make("rigid", lambda a: a + 77)), "not"),
    "a plate twice": (
        both(
            lambda them: them.update(
                {
                    name: np.concatenate([them[name]] * 2)
                    for name in ("rigid", "rigid_held", "rigid_force", "rigid_moment")
                }
            )
        ),
        "twice",
    ),
    "another surface below": (low(make("rigid", lambda a: a * 0)), "tractions|rigid"),
    "a plate that supports hold": (
        both(lambda them: them["held"].__setitem__(them["surface"] == them["rigid"][0], 1)),
        "held by supports",
    ),
    "not finite": (both(put("rigid_force", (0, 0), np.nan)), "not finite"),
    "flags": (both(put("rigid_held", (0, 0), 2)), "flags"),
    "one number": (both(make("rigid_force", lambda a: a[:, 0])), "the shape of"),
    "no flags": (both(drop("rigid_held")), "missing"),
    "half the bound": (high(times("bound", 0.5)), "only|above"),
    "no stress under the plate": (alone("lower", pushed_for_nothing), "left of piece"),
    "twice the bound": (low(times("bound", 2.0)), "rigid forces"),
}


@pytest.mark.parametrize("name", RIGID)
def test_a_forged_plate(honest: Halves, tmp_path: Path, name: str) -> None:
    forge, why = RIGID[name]
    said = said_of_forged(honest, forge, tmp_path)
    assert re.search(why, said), said
