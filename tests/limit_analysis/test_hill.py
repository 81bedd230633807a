"""Test limit loads and strict bounds for rolled metal: exact blocks, paths and bounds."""

import math
from pathlib import Path

from mpi4py import MPI

import pytest

from meshes.strip_footing import write_strip_footing
from perfplast_fenicsx import (
    Contact,
    Elastic,
    Hill,
    Newton,
    Pressure,
    Problem,
    ResultFolder,
    Support,
    VonMises,
    read_gmsh,
    stacked_blocks,
)
from perfplast_fenicsx.io.results.proof_file import write_proof
from perfplast_fenicsx.limit_analysis import BodyBounds, limit_bounds, limit_load
from perfplast_fenicsx.limit_analysis.body.proof_arrays import proofs
from perfplast_fenicsx.limit_analysis.discrete.discrete_limit import interior_point
from perfplast_fenicsx.proof import check
from tests.models import Read
from tests.random_bodies import Stack, write_stack

COMM = MPI.COMM_WORLD
F, G, H, YIELD = 0.4, 0.3, 0.7, 450.0
ALONG = {"y": 1 / math.sqrt(F + H), "x": 1 / math.sqrt(G + H), "z": 1 / math.sqrt(F + G)}
FLAT = YIELD / math.sqrt(H + F * G / (F + G))
FREE = YIELD / math.sqrt(F + H)
SHEET = Hill(2e5, 0.3, YIELD, ALONG["x"], ALONG["y"], ALONG["z"], 0.8, 1.3, 1.1)


def test_exact_values_are_the_known_ones() -> None:
    assert FLAT == pytest.approx(482.055, abs=5e-4)
    assert FREE == pytest.approx(429.058, abs=5e-4)


def proven(bounds: BodyBounds, path: Path) -> None:
    """Check both halves from their file. Collective."""
    folder = ResultFolder(COMM, path)
    write_proof(folder, folder.file("bounds.h5"), *proofs(bounds, bounds))
    checked = check(folder.file("bounds.h5"))
    assert set(checked) == {"lower", "upper"}
    for kind, half in checked.items():
        assert not half.faults, half
        bound = bounds.lower if kind == "lower" else bounds.upper
        assert half.proven == pytest.approx(bound.value, rel=1e-8)


@pytest.mark.parametrize("turned", [False, True])
def test_pressed_flat(shared_tmp_path: Path, turned: bool) -> None:
    """Return a block between smooth platens in plane strain; its axes may be interchanged."""
    sheet = SHEET
    if turned:  # the first axis is along y
        sheet = Hill(2e5, 0.3, YIELD, ALONG["y"], ALONG["x"], ALONG["z"], 0.8, 1.1, 1.3, 90.0)
    path = shared_tmp_path / "stack.msh"
    if COMM.rank == 0:
        write_stack(path, Stack(3, 2, [0.8], [(1.0, 1.0)], 0.4, True))
    COMM.barrier()
    problem = Problem(
        read_gmsh(COMM, path),
        {"block0": sheet},
        [Support("x0", "x"), Support("bottom", "y")],
        [Pressure("top", 1.0)],
        degree=2,
    )
    bounds = limit_bounds(problem, 1e-6)
    assert bounds.strict
    assert bounds.lower.value == pytest.approx(FLAT, rel=2e-6)
    assert bounds.upper.value == pytest.approx(FLAT, rel=2e-6)
    proven(bounds, shared_tmp_path)


def blocks(lower: object, degree: int = 2) -> Problem:
    return Problem(
        stacked_blocks(COMM, 1),
        {"lower": lower, "upper": Elastic(2e5, 0.3)},  # type: ignore[dict-item]
        [Support("x0", "x"), Support("y0", "y"), Support("bottom", "z")],
        [Pressure("top", 1.0)],
        [Contact("lower_top", "upper_bottom")],
        degree=degree,
    )


def up() -> Hill:
    """Return a block that is loaded along z, which is the y axis of the sheet."""
    return Hill(2e5, 0.3, YIELD, ALONG["x"], ALONG["z"], ALONG["y"], 1.3, 0.8, 1.1)


@pytest.mark.mpi2
def test_free_sides(shared_tmp_path: Path) -> None:
    bounds = limit_bounds(blocks(up()), 1e-6)
    assert bounds.strict
    assert bounds.lower.value == pytest.approx(FREE, rel=2e-6)
    assert bounds.upper.value == pytest.approx(FREE, rel=2e-6)
    proven(bounds, shared_tmp_path)


def test_newton_and_a_path_reach_it() -> None:
    problem = blocks(up())
    assert Newton(problem).solve(0.99 * FREE).report.converged
    assert not Newton(problem).solve(1.01 * FREE).report.converged
    found = limit_load(problem, 1e-3, method="path")
    assert found.lower == pytest.approx(FREE, rel=2e-3)
    assert found.upper == pytest.approx(FREE, rel=2e-3)


def test_equal_ratios_are_von_mises(read: Read) -> None:
    mesh = read(write_strip_footing, width=4.0, depth=2.0, grading=1.0, size=0.5)
    supports = [Support("x0", "x"), Support("side", "x"), Support("bottom")]
    one, other = (
        interior_point(
            Problem(mesh, {"ground": it}, supports, [Pressure("footing", 1.0)], degree=2)
        )
        for it in (Hill(2e5, 0.3, YIELD, angle=30.0), VonMises(2e5, 0.3, YIELD))
    )
    assert one.lower == pytest.approx(other.lower, rel=1e-8)
    assert one.upper == pytest.approx(other.upper, rel=1e-8)


def test_a_footing_on_turned_sheet(read: Read, shared_tmp_path: Path) -> None:
    """The axes mix shear and normal stresses: test bounds, their shares and the checker."""
    mesh = read(write_strip_footing, width=4.0, depth=2.0, grading=1.0, size=0.5)
    supports = [Support("x0", "x"), Support("side", "x"), Support("bottom")]
    sheet = Hill(2e5, 0.3, YIELD, 1.0, 0.953, 1.195, 0.8, 1.3, 1.1, 25.0)
    bounds = limit_bounds(
        Problem(mesh, {"ground": sheet}, supports, [Pressure("footing", 1.0)], degree=2)
    )
    assert bounds.strict
    low, high = bounds.lower.value, bounds.upper.value
    assert low is not None and high is not None and bounds.shares is not None
    assert COMM.allreduce(float(bounds.shares.sum())) == pytest.approx(high - low, rel=1e-6)
    proven(bounds, shared_tmp_path)
