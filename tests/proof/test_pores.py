"""Test that forged pore pressures are refused, in honest proofs of wet ground beside dry ground."""

import re
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx import (
    Contact,
    DruckerPrager,
    Plane,
    PorePressure,
    Pressure,
    Problem,
    Support,
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

WET = "constant_pore_pressure"


@pytest.fixture(scope="module", params=[2, 3])
def honest(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Halves:
    """Return the halves of a proof of two ground blocks; the lower one has pore water."""
    dim, path = request.param, tmp_path_factory.mktemp("honest")
    it = Stack(1, dim, (0.7, 1.2), ((1.0, 1.0),) * 2, 0.4 if dim == 2 else 0.7, plain=True)
    write_stack(path / "stack.msh", it)
    ground = DruckerPrager(1e3, 0.3, 1.0, 20.0, "compression")
    problem = Problem(
        read_gmsh(MPI.COMM_WORLD, path / "stack.msh"),
        {"block0": ground, "block1": ground},
        [Support("x0", "x"), *([Support("y0", "y")] if dim == 3 else [])],
        [Pressure("top", 1.0), PorePressure("block0", f"0.3*(0.9 - {'xyz'[dim - 1]})")],
        [Contact("block0_seam0", "block1_seam0")],
        [Plane("bottom", [0.0] * dim, [0.0] * (dim - 1) + [1.0])],
        degree=2,
    )
    found = written(path, limit_bounds(problem))
    assert "in the pores of a volume of 0.7" in check(path / "bounds.h5")["lower"].words[0]
    return found


def elsewhere(them: Arrays) -> None:
    """Move the pressure to the other cells."""
    them[WET] = them[WET][::-1].copy()


PORES: dict[str, tuple[Forgery, str]] = {
    "left away": (alone("lower", drop(WET)), "equilibrium|tractions"),
    "left away above": (high(in_turn(drop(WET), times("bound", 2.0))), "different loads"),
    "half as much below": (low(times(WET, 0.5)), "equilibrium|tractions"),
    "half as much, alone above": (alone("upper", times(WET, -5.0)), "only"),
    "more at a vertex": (low(put(WET, (0, 0), 0.5)), "equilibrium|tractions"),
    "in other cells": (low(elsewhere), "equilibrium|tractions"),
    "in other cells above": (high(in_turn(elsewhere, times("bound", 9.0))), "different loads"),
    "of another sign": (low(times(WET, -1.0)), "equilibrium|tractions"),
    "that grows": (
        low(lambda them: them.update({"pore_pressure": them.pop(WET)})),
        "equilibrium|tractions",
    ),
    "not finite": (both(put(WET, (0, 0), np.nan)), "not finite"),
    "one number a cell": (both(make(WET, lambda a: a[:, 0])), "the shape of"),
    "complex": (both(make(WET, lambda a: a + 0j)), "consist of numbers"),
    "a shift that hides tension": (
        low(
            lambda them: them.update(
                {"stress": them["stress"] + 0.5 * np.eye(them["stress"].shape[-1])}
            )
        ),
        "tractions|times as large",
    ),
}


@pytest.mark.parametrize("name", PORES)
def test_a_forged_pressure(honest: Halves, tmp_path: Path, name: str) -> None:
    forge, why = PORES[name]
    said = said_of_forged(honest, forge, tmp_path)
    assert re.search(why, said), said


def test_a_file_without_pores_is_as_before(honest: Halves, tmp_path: Path) -> None:
    """Zeros have the same effect: without the pressure, the stress proves nothing."""
    halves = {kind: dict(of) for kind, of in honest.items()}
    for of in halves.values():
        of["pore_pressure"] = np.zeros(of[WET].shape)
    checked = check(write(tmp_path / "zeros.h5", halves))
    assert not any(of.faults for of in checked.values())
