"""Test that forged cone slopes are refused, in honest proofs of ground beside steel."""

from collections.abc import Callable
from pathlib import Path

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
import pytest

from perfplast_fenicsx import (
    BodyForce,
    Contact,
    DruckerPrager,
    Plane,
    Pressure,
    Problem,
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
    write,
    written,
)
from tests.random_bodies import Stack, write_stack

pytestmark = pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="the checker is serial")


@pytest.fixture(scope="module", params=[2, 3])
def honest(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Halves:
    """Return the halves of a proof of ground on a plane, under a von Mises block with weight."""
    dim, path = request.param, tmp_path_factory.mktemp("honest")
    it = Stack(1, dim, (0.7, 1.2), ((1.0, 1.0),) * 2, 0.4 if dim == 2 else 0.7, plain=True)
    write_stack(path / "stack.msh", it)
    steel = VonMises(young=1e3, poisson=0.3, yield_stress=9.0)
    problem = Problem(
        read_gmsh(MPI.COMM_WORLD, path / "stack.msh"),
        {"block0": DruckerPrager(1e3, 0.3, 1.0, 20.0, "compression"), "block1": steel},
        [Support("x0", "x"), *([Support("y0", "y")] if dim == 3 else [])],
        [Pressure("top", 1.0), BodyForce("block1", [0.0] * (dim - 1) + [-0.1])],
        [Contact("block0_seam0", "block1_seam0")],
        [Plane("bottom", [0.0] * dim, [0.0] * (dim - 1) + [1.0])],
        degree=2,
    )
    found = written(path, limit_bounds(problem))
    assert "times the mean stress" in check(path / "bounds.h5")["lower"].words[0]
    return found


def other_way_round(cones: npt.NDArray) -> npt.NDArray:
    """Exchange the cones of the bodies."""
    return np.asarray(cones.max() - cones)


def sucked(them: Arrays) -> None:
    """Reverse all stresses and loads: the pressure becomes a tension."""
    for name in ("stress", "traction", "body_force"):
        them[name] = -them[name]
    for name in ("contacts", "contact_adhesion", "contact_friction"):
        them[name] = them[name][:0]


def negative_strength(them: Arrays) -> None:
    """Increase the slope, as if pressure added more strength to the ground."""
    them["cone_slope"] = 3 * them["cone_slope"]


SLOPES: dict[str, tuple[Forgery, str]] = {
    "none at all": (both(drop("cone_slope")), "missing"),
    "too few": (both(make("cone_slope", lambda a: a[1:])), "the shape of"),
    "of another kind": (both(make("cone_slope", lambda a: a + 0j)), "consist of numbers"),
    "not finite": (both(put("cone_slope", 0, np.inf)), "not finite"),
    "no number": (both(put("cone_slope", 0, np.nan)), "not finite"),
    "a stress of weaker ground": (
        alone("lower", times("cone_slope", 0.99)),
        "times as large as they may be",
    ),
    "a stress of ground without any": (
        alone("lower", times("cone_slope", 0.0)),
        "times as large as they may be",
    ),
    "a stress that pulls": (alone("lower", sucked), "times as large as they may be"),
    "a velocity that grows too little": (
        alone("upper", times("cone_slope", 1.01)),
        "dilate too little",
    ),
    "a velocity that ought not to grow": (
        alone("upper", times("cone_slope", 0.0)),
        "only",
    ),
    "a velocity that grows through more strength": (
        alone("upper", times("cone_slope", 0.99)),
        "only",
    ),
    "of stronger ground below": (low(negative_strength), "of other shapes"),
    "of stronger ground above": (high(times("cone_slope", 0.5)), "of other shapes"),
    "of the other body": (
        both(make("cone", other_way_round)),
        "times as large|only",
    ),
    "a claim too high": (low(in_turn(times("bound", 1.001))), "outer tractions|equilibrium"),
    "a claim too low": (high(times("bound", 0.999)), "only"),
}


@pytest.mark.parametrize("name", list(SLOPES))
def test_a_forged_slope_is_refused(honest: Halves, tmp_path: Path, name: str) -> None:
    forge, words = SLOPES[name]
    said = said_of_forged(honest, forge, tmp_path)
    assert any(word in said for word in words.split("|")), said


@pytest.mark.parametrize(
    ("change", "proven"),
    [
        (times("cone_slope", 1.5), "lower"),
        (in_turn(times("cone_bound", 2.0), times("bound", 2.0)), "upper"),
    ],
)
def test_what_is_stronger_is_another_proof(
    honest: Halves, tmp_path: Path, change: Callable[[Arrays], object], proven: str
) -> None:
    """Ground with a larger slope also carries the stress; stronger ground has this velocity."""
    half = {k: v.copy() for k, v in honest[proven].items()}
    change(half)
    found = check(write(tmp_path / "other.h5", {proven: half}))
    assert not found[proven].faults
