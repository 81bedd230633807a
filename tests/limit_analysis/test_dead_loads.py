"""Test limit loads and strict bounds with constant loads."""

import math
from dataclasses import replace
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest

from meshes.vertical_cut import write_vertical_cut
from perfplast_fenicsx import (
    Adaptation,
    BodyForce,
    Contact,
    Pressure,
    Problem,
    ResultFolder,
    Support,
    Traction,
    VonMises,
    adaptive_bounds,
    limit_load,
)
from perfplast_fenicsx.io.results.proof_file import write_proof
from perfplast_fenicsx.limit_analysis.body.body_bounds import BodyBounds
from perfplast_fenicsx.limit_analysis.body.limit_bounds import limit_bounds
from perfplast_fenicsx.limit_analysis.body.proof_arrays import proofs
from perfplast_fenicsx.limit_analysis.conic.interior_iteration import NewtonDirections, Unknowns
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitLoad
from perfplast_fenicsx.limit_analysis.statements.load_factor import Question
from perfplast_fenicsx.proof import Checked, check
from perfplast_fenicsx.proof.checker import check_lower, check_upper
from perfplast_fenicsx.proof.plain_arrays import stored_arrays
from tests.contact.blocks_apart import blocks_apart
from tests.limit_analysis.test_static_bound import rectangle
from tests.models import Read, touching_blocks

K = 1.0
"""Yield stress in shear."""

SOIL = VonMises(1e3, 0.3, math.sqrt(3) * K)
STEEL = VonMises(2e5, 0.3, 300.0)
RTOL = 1e-4


def block(sign: float, lateral: float, weight: float = 0.0, n: int = 2) -> Problem:
    """Return a unit square on rollers; ζ presses or pulls on top, and other loads are constant."""
    mesh = rectangle(
        (n, n),
        (1.0, 1.0),
        {"block": lambda x: x[1] < 2},
        {
            "x0": lambda x: x[0] < 1e-9,
            "y0": lambda x: x[1] < 1e-9,
            "x1": lambda x: x[0] > 1 - 1e-9,
            "top": lambda x: x[1] > 1 - 1e-9,
        },
    )
    loads: list[Pressure | BodyForce] = [Pressure("top", sign)]
    if lateral:
        loads.append(Pressure("x1", lateral, constant=True))
    if weight:
        loads.append(BodyForce("block", (0.0, -weight), constant=True))
    supports = [Support("x0", "x"), Support("y0", "y")]
    return Problem(mesh, {"block": SOIL}, supports, loads, degree=2)


def footing(live: tuple[float, float], dead: tuple[float, float], n: int = 2) -> Problem:
    """Return a strip of unit width on ground 8 wide and 2 deep, with tractions on the strip."""
    mesh = rectangle(
        (8 * n, 2 * n),
        (8.0, 2.0),
        {"ground": lambda x: x[1] < 3},
        {
            "bottom": lambda x: x[1] < 1e-9,
            "strip": lambda x: (x[1] > 2 - 1e-9) & (np.abs(x[0] - 4) < 0.5 + 1e-9),
        },
    )
    loads = [Traction("strip", live)] if any(live) else []
    loads += [Traction("strip", dead, constant=True)] if any(dead) else []
    return Problem(mesh, {"ground": SOIL}, [Support("bottom")], loads, degree=2)


def checked(low: BodyBounds, high: BodyBounds, folder: Path) -> dict[str, Checked]:
    """Return the checker's results for both halves, which have no faults."""
    there = ResultFolder(MPI.COMM_WORLD, folder)
    write_proof(there, there.file("bounds.h5"), *proofs(low, high))
    found = check(there.file("bounds.h5"))
    assert set(found) == {"lower", "upper"}
    for of in found.values():
        assert not of.faults
    return found


@pytest.mark.long(but=["1.0-0.5", "-1.0-0.5", "-1.0-5.0", "-1.0--3.0", "-1.0-10000.0"])
@pytest.mark.mpi2("1.0-0.5")
@pytest.mark.parametrize("lateral", [0.5, 5.0, -3.0, 1e4])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_both_ends_of_what_a_block_carries(
    shared_tmp_path: Path, sign: float, lateral: float
) -> None:
    """|σx − σy| ≤ 2k: pressures on top and side differ by at most 2k."""
    problem, exact = block(sign, lateral), sign * lateral + 2 * K
    found = limit_load(problem, RTOL)
    assert found.method == "interior-point"
    assert found.upper is not None
    assert exact - RTOL * 2 * K <= found.lower <= exact + 1e-9 * abs(exact)
    assert found.upper == pytest.approx(exact, rel=1e-9)
    bounds = limit_bounds(problem, RTOL)
    assert bounds.strict
    assert exact - 2 * RTOL * 2 * K <= (bounds.lower.value or 0.0)
    proven = checked(bounds, bounds, shared_tmp_path)
    assert (proven["lower"].proven or np.inf) <= exact <= (proven["upper"].proven or -np.inf) + 1e-7
    outside = "not carry the constant loads alone" in bounds.in_words()
    assert outside == (exact < 0)


def test_weight_lowers_what_a_column_carries() -> None:
    """A column fails at its foot, at 2k minus its weight, if the mesh is fine enough."""
    plain, heavy = limit_bounds(block(1.0, 0.0)), limit_bounds(block(1.0, 0.0, weight=0.5))
    assert heavy.strict
    assert heavy.upper.value is not None
    assert plain.lower.value is not None
    assert plain.lower.value - 0.5 <= heavy.upper.value < plain.lower.value


def test_dead_loads_that_are_a_share_of_the_live_ones() -> None:
    """If dead loads are a share of the limit load, λ decreases by this share."""
    plain = limit_load(footing((0.3, -1.0), (0.0, 0.0)), RTOL)
    assert plain.estimate is not None
    for share in (0.5, 0.99, -2.0):
        beside = limit_load(
            footing((0.3, -1.0), (0.3 * share * plain.estimate, -share * plain.estimate)), RTOL
        )
        assert beside.estimate is not None
        expected = (1 - share) * plain.estimate
        assert beside.estimate == pytest.approx(expected, abs=2 * RTOL * plain.estimate)


def parting_blocks() -> Problem:
    """Return two blocks in contact under a constant pressure of 100; a pull of 100 lifts one."""
    return touching_blocks(
        materials={"lower": STEEL, "upper": STEEL},
        loads=[Pressure("top", -1.0), Pressure("top", 100.0, constant=True)],
        degree=2,
    )


def meets_the_load_that_lifts(found: LimitLoad) -> bool:
    """Return whether bounds are 100 to RTOL times the measure for bounds without dissipation.

    This measure is a thousandth of the load (:func:`load_factor.measure_of`).
    """
    assert found.upper is not None
    near = 1e-3 * RTOL * 100
    return 100 * (1 - 1e-9) <= found.upper <= 100 + near and abs(found.lower - 100) <= near


def test_bodies_part_at_the_load_that_lifts_what_presses() -> None:
    """Nothing dissipates, no contact force remains, and contact holds no pair."""
    problem = parting_blocks()
    assert meets_the_load_that_lifts(limit_load(problem, RTOL))
    bounds = limit_bounds(problem, 1e-3)
    assert bounds.strict
    assert (bounds.lower.value or 0) <= 100.0 <= (bounds.upper.value or 0) * (1 + 1e-9)


def test_factors_of_rounding_spoil_no_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    """If bodies separate, the last K may be singular up to rounding, and balance no forces."""
    asked = []

    def spoilt(_: NewtonDirections, now: Unknowns) -> Unknowns:
        asked.append(now)
        forces = now.forces + 1e13 * (np.arange(len(now.forces)) == 0)
        return replace(now, borne=replace(now.borne, forces=forces))

    monkeypatch.setattr(NewtonDirections, "balanced", spoilt)
    assert meets_the_load_that_lifts(limit_load(parting_blocks(), RTOL))
    assert len(asked) == 1


@pytest.mark.long
def test_green(shared_tmp_path: Path) -> None:
    """A constant shear is half of what a strip carries: 4.484019 (A.

    P. Green, J. Appl. Mech. 1954).
    """
    exact = 4.484019 * K
    found = adaptive_bounds(footing((0.0, -1.0), (0.5 * K, 0.0)), Adaptation(0.01, 1200))
    assert found.lower.strict
    assert found.upper.strict
    assert 0.95 * exact < (found.lower.value or 0) < exact < (found.upper.value or 0) < 1.03 * exact
    checked(found.low, found.high, shared_tmp_path)


@pytest.mark.long(but=["live1"])
@pytest.mark.parametrize("live", [(0.0, -1.0), (0.0, 0.0)])
def test_constant_loads_that_are_too_much(shared_tmp_path: Path, live: tuple[float, float]) -> None:
    """A shear of 2k acts on a strip that carries k.

    No pressure helps: strengths lack a factor 2.
    """
    problem = footing(live, (2 * K, 0.0))
    found = adaptive_bounds(problem, Adaptation(0.05, 700))
    assert found.body.question is Question.STANDS
    lower, upper = found.lower, found.upper
    assert lower.strict
    assert upper.strict
    assert 0.4999 < (lower.value or 0) <= 0.5 * (1 + 1e-9)
    assert 0.5 <= (upper.value or 0) < 0.56
    assert all(bound.value is None for bound in found.body.limits)
    assert "does not stand" in found.body.in_words()
    assert "fall short by a factor of at least 1.9" in found.body.in_words()
    proven = checked(found.low, found.high, shared_tmp_path)
    words = " ".join(proven["upper"].words + proven["lower"].words)
    assert ("with arbitrary factors" in words) == any(live)
    mesh = limit_load(problem, 1e-3, method="interior-point")
    assert mesh.question is Question.STANDS
    assert mesh.standing is not None
    assert mesh.standing.falls
    assert mesh.collapses
    assert np.isinf(mesh.lower)


@pytest.mark.long
def test_a_growing_load_where_nothing_moves(shared_tmp_path: Path, read: Read) -> None:
    """A cut cannot carry its weight; a growing pressure acts on ground that does not move then."""
    ground = read(write_vertical_cut, size=0.2, width=1.5, depth=0.5)
    weight = BodyForce("ground", (0.0, -4.4 * K), constant=True)
    held = [Support("sides"), Support("bottom")]
    found = limit_bounds(
        Problem(ground, {"ground": SOIL}, held, [Pressure("floor", 1.0), weight], degree=2)
    )
    assert found.question is Question.STANDS
    assert found.strict
    assert 3.7752 / 4.4 < (found.upper.value or 0.0) < 1
    proven = checked(found, found, shared_tmp_path)
    assert "with arbitrary factors" in proven["lower"].words[0]
    assert "any factor of the free loads up to" in proven["upper"].words[-1]


@pytest.mark.serial
def test_forged_dead_loads(shared_tmp_path: Path) -> None:
    """The checker finds faults in changed constant loads."""
    import h5py

    bounds = limit_bounds(block(1.0, -3.0))
    checked(bounds, bounds, shared_tmp_path)
    with h5py.File(shared_tmp_path / "bounds.h5") as file:
        lower, upper = stored_arrays(file, "lower"), stored_arrays(file, "upper")
    for arrays, judge in ((lower, check_lower), (upper, check_upper)):
        assert not judge(arrays).faults
        pushes = arrays["constant_traction"]
        assert judge({**arrays, "constant_traction": 0.99 * pushes}).faults
        without = {name: values for name, values in arrays.items() if "constant" not in name}
        with pytest.raises(ValueError, match="negative"):
            judge(without)
        with pytest.raises(ValueError, match="shape"):
            judge({**arrays, "constant_traction": pushes[1:]})
        with pytest.raises(ValueError, match="not finite"):
            judge({**arrays, "constant_body_force": np.nan * arrays["constant_body_force"]})
    higher = {**lower, "stress": (1 + 1e-6) * lower["stress"]}
    assert check_lower(higher).faults
    assert any("only" in fault for fault in check_upper({**upper, "bound": -1.01}).faults)
    # a slightly inadmissible stress cannot be scaled down if loads are constant
    weaker = {**lower, "cone_bound": (1 - 1e-4) * lower["cone_bound"]}
    assert any("times as large" in fault for fault in check_lower(weaker).faults)


@pytest.mark.serial
def test_forged_loads_of_any_factor(shared_tmp_path: Path) -> None:
    """A mechanism on which loads of any factor do work proves nothing for other factors."""
    import h5py

    bounds = limit_bounds(footing((0.0, -1.0), (2 * K, 0.0)))
    assert bounds.question is Question.STANDS
    checked(bounds, bounds, shared_tmp_path)
    with h5py.File(shared_tmp_path / "bounds.h5") as file:
        lower, upper = stored_arrays(file, "lower"), stored_arrays(file, "upper")
    turned = upper["any_traction"] + 1e-3 * upper["traction"]
    assert any(
        "work of others" in of for of in check_upper({**upper, "any_traction": turned}).faults
    )
    assert check_lower({**lower, "any_factor": lower["any_factor"] + 1e-6}).faults
    with pytest.raises(ValueError, match="any_factor is not finite"):
        check_lower({**lower, "any_factor": np.nan})


def test_water_on_both_sides_of_a_contact() -> None:
    """The water lifts the upper block by its weight. No smaller load strains a body."""
    block = VonMises(1e4, 0.3, 10.0)
    problem = Problem(
        blocks_apart(MPI.COMM_WORLD, (2, 2), (2, 2), moved_by=0.0),
        {"lower": block, "upper": block},
        [Support("bottom")],
        [
            BodyForce("upper", [0.0, -1.0], constant=True),
            Pressure("lower_top", 1.0),
            Pressure("upper_bottom", 1.0),
        ],
        [Contact("lower_top", "upper_bottom")],
        degree=2,
    )
    bounds = limit_bounds(problem, 1e-4)
    assert bounds.strict
    assert bounds.lower.value == pytest.approx(1.0, rel=1e-4)
    assert bounds.upper.value == pytest.approx(1.0, rel=1e-4)
