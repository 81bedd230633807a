"""Test limit loads with Tresca friction, and Drucker's bounds with Coulomb friction."""

import math
from dataclasses import replace
from functools import partial
from typing import Any

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx import (
    BodyForce,
    Contact,
    Elastic,
    Newton,
    OutputFields,
    Pressure,
    Problem,
    Support,
    Traction,
    WorkNewton,
    limit_bounds,
    limit_load,
)
from perfplast_fenicsx.limit_analysis import DruckerBounds, drucker_bounds
from perfplast_fenicsx.limit_analysis.body.singular_points import with_room_for_stress
from perfplast_fenicsx.rounding import rounded_up
from tests.checks import assert_refused, assert_solved
from tests.contact.blocks_apart import blocks_apart
from tests.models import STEEL

K = STEEL.yield_stress / math.sqrt(3)
PLATEN = Elastic(young=206900e3, poisson=0.29)


def aside(gdim: int, shear: float, **friction: float) -> Problem:
    """Return a block pushed down and aside on another block with a separate mesh."""
    force = [shear * 0.8, shear * 0.6][: gdim - 1] if gdim == 3 else [shear]
    return Problem(
        blocks_apart(MPI.COMM_WORLD, [2] * gdim, [3] * gdim),
        {"lower": STEEL, "upper": STEEL},
        [Support("bottom")],
        [Traction("top", (*force, -1.0))],
        [Contact("lower_top", "upper_bottom", **friction)],  # type: ignore[arg-type]
        degree=2,
    )


@pytest.mark.mpi2("2")
@pytest.mark.parametrize("gdim", [2, 3])
def test_cones_of_friction_let_a_block_slide(gdim: int) -> None:
    """Static and kinematic loads meet where the lateral force is τ̄A."""
    found = limit_load(aside(gdim, 0.25, tresca=10.0), 1e-5)
    assert found.lower <= 40 * (1 + 1e-8)
    assert found.upper is not None
    assert found.upper >= 40 * (1 - 1e-8)
    assert found.upper - found.lower < 1e-5 * 40


@pytest.mark.serial
def test_path_and_interior_point_agree_where_bodies_flow_and_slip() -> None:
    """Both brackets for a block under a rough platen overlap, above 2k and below the tied value."""
    problem = Problem(
        blocks_apart(MPI.COMM_WORLD, (3, 2), (2, 1)),
        {"lower": STEEL, "upper": PLATEN},
        [Support("x0", "x"), Support("upper_x0", "x"), Support("bottom", "y")],
        [Pressure("top", 1.0)],
        [Contact("lower_top", "upper_bottom", tresca=0.3 * K)],
        degree=2,
    )
    problem = with_room_for_stress(problem)  # as bounds for the body do
    direct, path = (limit_load(problem, 5e-3, method=name) for name in ("interior-point", "path"))
    assert direct.upper is not None
    assert path.upper is not None
    assert path.lower <= direct.upper
    assert direct.lower <= path.upper * (1 + 1e-9)
    assert path.upper - path.lower < 1e-2 * path.upper
    assert 2 * K < direct.lower
    proven = limit_bounds(problem, 5e-3)
    assert proven.strict
    assert proven.lower.value is not None
    assert proven.upper.value is not None
    assert proven.lower.value <= path.upper
    assert path.lower <= proven.upper.value < 1.05 * proven.lower.value


def test_coulombs_friction_has_druckers_bounds_and_no_limit_theorem() -> None:
    problem = aside(2, 0.3, coulomb=0.2)
    bounds = drucker_bounds(problem)
    rough = limit_load(aside(2, 0.3, tresca=1e4))
    assert bounds.lower == pytest.approx(0.0, abs=1e-6)
    assert bounds.upper is not None
    assert rough.lower < bounds.upper < 1.2 * rough.lower  # a tie also holds surfaces together
    words = bounds.in_words()
    assert "may slide at any load, as without friction they carry none" in words
    assert (
        f"at {rounded_up(bounds.upper)} at the latest, the limit load if nothing slipped" in words
    )
    direct = partial(limit_load, problem, method="interior-point")
    assert_refused(direct, ["no limit theorem", "Drucker's pair", "tresca"])


@pytest.mark.parametrize(
    ("bound", "words"),
    [
        (math.inf, "would carry any load if nothing"),
        (None, "not found"),
        (2.0, "at 2 at the latest"),
    ],
)
def test_what_was_not_found_is_not_said_to_be_without_end(bound: float | None, words: str) -> None:
    assert words in DruckerBounds(1.0, bound).in_words()


def test_elastic_bodies_that_cannot_slip_carry_without_end() -> None:
    problem = aside(2, 0.3, coulomb=0.2)
    elastic = Elastic(STEEL.young, STEEL.poisson)
    given = replace(problem.given, materials={"lower": elastic, "upper": elastic})
    assert drucker_bounds(Problem.from_given(problem.tagged_mesh, given)).upper == math.inf


def test_a_block_slides_up_a_slope(comm: MPI.Intracomm) -> None:
    """NAFEMS CGS-4: F/G = (tan α + μ)/(1 − μ tan α) for any elastic bodies."""
    angle = math.atan(0.1)
    c, s = math.cos(angle), math.sin(angle)
    problem = Problem(
        blocks_apart(comm, (3, 3), (4, 4)),
        {"lower": STEEL, "upper": STEEL},
        [Support("bottom")],
        [BodyForce("upper", (-s, -c), constant=True), BodyForce("upper", (c, -s))],
        [Contact("lower_top", "upper_bottom", coulomb=0.3)],
    )
    solver = WorkNewton(problem)
    rest = solver.at_rest()
    level = rest
    for further in (1e-5, 1e-3):
        level = solver.solve(rest.state.alpha + further, level.state)
        assert_solved(level)
    assert level.report.zeta == pytest.approx(0.4 / 0.97, rel=1e-9)
    assert level.report.slipping == problem.friction.count
    below, above = (Newton(problem).solve(zeta) for zeta in (0.41, 0.42))
    assert_solved(below)
    assert below.report.rounds > 1
    assert not above.report.converged
    assert "Coulomb" in above.report.reason


@pytest.mark.mpi2
def test_slip_and_friction_are_fields(comm: MPI.Intracomm) -> None:
    """Friction is τ̄ if all nodes slip, opposite on both surfaces, and sums to zero."""
    problem: Any = Problem(
        blocks_apart(comm, (2, 2), (3, 3)),
        {"lower": STEEL, "upper": STEEL},
        [Support("bottom"), Support("upper_x0", "x")],
        [Traction("top", (0.5, -1.0))],
        [Contact("lower_top", "upper_bottom", tresca=2.0)],
    )
    level = Newton(problem).solve(100.0)
    assert_solved(level)
    fields = OutputFields(problem).update(level)
    slip, friction = (fields[name].x.array.reshape(-1, 2) for name in ("slip", "friction_stress"))
    assert comm.allreduce(float(np.abs(slip[:, 0]).max(initial=0)), MPI.MAX) > 1e-6
    assert np.abs(slip[:, 1]).max(initial=0) < 1e-12
    largest = comm.allreduce(float(np.abs(friction[:, 0]).max(initial=0)), MPI.MAX)
    assert 1.9 < largest < 4.0
    both = friction[:, 0] if comm.size == 1 else None
    assert both is None or (both.min() < -1.5 and both.max() > 1.5)
