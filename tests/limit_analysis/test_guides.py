"""Test supports along normals of flat surfaces: parts of a body have the bounds of the whole."""

import math
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx import (
    Force,
    Newton,
    Plane,
    Pressure,
    Problem,
    ResultFolder,
    RigidSurface,
    Support,
    VonMises,
)
from perfplast_fenicsx.io.results.proof_file import write_proof
from perfplast_fenicsx.limit_analysis import (
    Adaptation,
    BodyBounds,
    adaptive_bounds,
    limit_bounds,
    limit_load,
)
from perfplast_fenicsx.limit_analysis.body.proof_arrays import proofs
from perfplast_fenicsx.proof import check
from tests.checks import assert_refused, assert_solved
from tests.symmetric_bodies import cube, square_tube

COMM = MPI.COMM_WORLD
WEAK = VonMises(young=1e3, poisson=0.3, yield_stress=math.sqrt(3))
TURNED = 0.3
RTOL = 1e-6


def tube(n: int, quarter: bool, turned: float = 0.0) -> Problem:
    """Return a quarter or an eighth of a square tube under internal pressure."""
    normal = "normal" if turned else "y"
    other = Support("x0", "x") if quarter else Support("diagonal", "normal")
    supports = [Support("y0", normal), other]
    mesh = square_tube(COMM, n, quarter, turned)
    return Problem(mesh, {"body": WEAK}, supports, [Pressure("inner", 1.0)], degree=2)


def pressed_cube(octant: bool, turned: float = 0.0) -> Problem:
    """Return a cube between rough platens, of which only the force is known."""
    if octant:
        supports = [Support("x0", "x"), Support("y0", "y")]
    else:
        supports = [Support("y0", "normal"), Support("diagonal", "normal")]
    return Problem(
        cube(COMM, 1, octant, turned),
        {"body": WEAK},
        [*supports, Support("bottom", "z"), RigidSurface("top", held="xy")],
        [Force("top", (0.0, 0.0, -1.0 if octant else -0.5))],
        degree=2,
    )


def values(bounds: BodyBounds) -> tuple[float, float]:
    """Return both bounds, which must be strict."""
    assert bounds.strict, bounds.why_not
    assert bounds.lower.value is not None
    assert bounds.upper.value is not None
    return bounds.lower.value, bounds.upper.value


@pytest.mark.mpi3
def test_an_eighth_of_a_tube_has_the_bounds_of_a_quarter() -> None:
    whole = values(limit_bounds(tube(2, quarter=True), rtol=RTOL))
    part = values(limit_bounds(tube(2, quarter=False, turned=TURNED), rtol=RTOL))
    assert part == pytest.approx(whole, rel=10 * RTOL)
    load = limit_load(tube(2, quarter=False), rtol=RTOL)
    assert load.lower == pytest.approx(limit_load(tube(2, quarter=True)).lower, rel=1e-3)


@pytest.mark.mpi3
def test_a_sixteenth_of_a_cube_has_the_bounds_of_an_octant() -> None:
    whole = values(limit_bounds(pressed_cube(octant=True), rtol=RTOL))
    part = values(limit_bounds(pressed_cube(octant=False, turned=TURNED), rtol=RTOL))
    assert part == pytest.approx(whole, rel=10 * RTOL)


def test_an_eighth_of_a_tube_deforms_as_a_quarter() -> None:
    whole, part = tube(2, quarter=True), tube(2, quarter=False, turned=TURNED)
    levels = [Newton(problem).solve(0.9) for problem in (whole, part)]
    for level in levels:
        assert_solved(level)
    works = [level.report.alpha for level in levels]
    assert 2 * works[1] == pytest.approx(works[0], rel=1e-8)
    reactions = [level.report.reactions for level in levels]
    assert max(level.report.balance for level in levels) < 1e-9
    pull = reactions[0]["support y0"][1]
    along, across = math.cos(TURNED), math.sin(TURNED)
    assert reactions[1]["support y0"] == pytest.approx([-across * pull, along * pull], rel=1e-8)


@pytest.mark.long
def test_planes_of_symmetry_stay_flat_where_meshes_are_refined(shared_tmp_path: Path) -> None:
    adapted = adaptive_bounds(tube(2, quarter=False, turned=TURNED), Adaptation(0.05, 250))
    assert adapted.lower.strict
    assert adapted.upper.strict
    path = shared_tmp_path / "bounds.h5"
    folder = ResultFolder(COMM, shared_tmp_path)
    write_proof(folder, path, *proofs(adapted.low, adapted.high))
    if COMM.rank == 0:
        for half in check(path).values():
            assert half.proven is not None, str(half)
            assert "along its normal" in half.words[0] or "same bodies" in half.words[0]


def test_what_is_no_plane_of_symmetry_is_refused() -> None:
    mesh, loads = square_tube(COMM, 2, quarter=True), [Pressure("inner", 1.0)]

    def refused(support: Support, *words: str, other: tuple[Support, ...] = ()) -> None:
        supports = [support, *other]
        assert_refused(lambda: Problem(mesh, {"body": WEAK}, supports, loads), words)

    refused(Support("inner", "normal"), "'inner'", "deviate by up to", "give letters")
    refused(Support("x0", "normals"), "components = 'normals'", "or 'normal'")
    moved = (Support("x0", "x", value=0.1),)
    refused(Support("x0", "normal"), "'x0'", "different amount", other=moved)
    mesh, loads = cube(COMM, 1, octant=False, turned=2e-4), [Pressure("top", 1.0)]
    nearly = (Support("diagonal", "y"),)
    refused(Support("y0", "normal"), "within 0.011° of", "where its surface meets", other=nearly)
    mesh, loads = square_tube(COMM, 2, quarter=True), [Pressure("inner", 1.0)]
    plate = [RigidSurface("inner", held="normal")]
    assert_refused(lambda: Problem(mesh, {"body": WEAK}, plate, loads), ["'normal'"])


def test_planes_may_have_coordinates_of_few_digits_and_several_names() -> None:
    mesh = square_tube(COMM, 2, quarter=True, turned=TURNED)
    mesh.mesh.geometry.x[:] = np.round(mesh.mesh.geometry.x, 5)
    supports = [Support("y0", "normal"), Support("x0", "normal")]
    problem = Problem(mesh, {"body": WEAK}, supports, [Pressure("inner", 1.0)], degree=2)
    assert abs(problem.guides.normals[0] @ problem.guides.normals[1]) < 1e-4
    assert_solved(Newton(problem).solve(0.5))
    mesh.mesh.geometry.x[:] = np.round(mesh.mesh.geometry.x, 2)
    given = (mesh, {"body": WEAK}, supports, [Pressure("inner", 1.0)])
    assert_refused(lambda: Problem(*given), ["deviate by up to 0."])


def rubbing_cube(octant: bool, turned: float = 0.0) -> Problem:
    """Return a cube that is pressed on a plane with Tresca friction."""
    if octant:
        supports = [Support("x0", "x"), Support("y0", "y")]
    else:
        supports = [Support("y0", "normal"), Support("diagonal", "normal")]
    plane = Plane("bottom", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), tresca=0.3, name="plane")
    mesh, loads = cube(COMM, 2, octant, turned), [Pressure("top", 1.0)]
    return Problem(mesh, {"body": WEAK}, supports, loads, obstacles=[plane], degree=2)


def test_what_rubs_at_planes_of_symmetry_resists_slip_along_them() -> None:
    whole, part = rubbing_cube(octant=True), rubbing_cube(octant=False, turned=TURNED)
    levels = [Newton(problem).solve(1.7) for problem in (whole, part)]
    for level in levels:
        assert_solved(level)
    assert 2 * levels[1].report.alpha == pytest.approx(levels[0].report.alpha, rel=1e-6)
    slips = [level.report.friction_dissipation for level in levels]
    assert 2 * slips[1] == pytest.approx(slips[0], rel=1e-6)
    loads = [limit_load(problem, rtol=RTOL).lower for problem in (whole, part)]
    assert loads[1] == pytest.approx(loads[0], rel=10 * RTOL)
