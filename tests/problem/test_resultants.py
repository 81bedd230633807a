"""Test resultants: known values, equilibrium for every algorithm, and refusals."""

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx import (
    AugmentedLagrangian,
    AugmentedLagrangianOptions,
    BodyForce,
    Contact,
    Level,
    Newton,
    Plane,
    Pressure,
    Problem,
    Support,
    WorkNewton,
    l_plate,
    stacked_blocks,
)
from perfplast_fenicsx.problem import certify
from perfplast_fenicsx.problem.fields.quadrature_fields import QuadratureFields
from tests.models import STEEL, two_blocks_problem
from tests.solvers.levels import TIGHT

WEIGHT = 30.0
NAMES = {
    *("loads", "support x0", "support y0", "contact lower_top upper_bottom", "obstacle bottom"),
}


def stack(degree: int = 1) -> Problem:
    """Return two stacked unit cubes on a rigid plane; the upper one has weight, and is pushed."""
    return Problem(
        stacked_blocks(MPI.COMM_WORLD, 2),
        {"lower": STEEL, "upper": STEEL},
        [Support("x0", "x"), Support("y0", "y"), Support("x0", "y")],
        [
            Pressure("top", 1.0),
            BodyForce("upper", (2.0, 0.0, -WEIGHT), constant=True),
            BodyForce("lower", (0.0, 0.0, -WEIGHT), constant=True),
        ],
        [Contact("lower_top", "upper_bottom")],
        [Plane("bottom", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0))],
        degree=degree,
    )


@pytest.mark.mpi3("1")
@pytest.mark.parametrize("degree", [1, 2])
def test_forces_by_hand(degree: int) -> None:
    level = Newton(stack(degree), TIGHT).solve(100.0)
    assert level.report.converged, level.report.reason
    forces = level.report.reactions
    assert set(forces) == NAMES
    assert forces["loads"] == pytest.approx([2.0, 0.0, -100 - 2 * WEIGHT], rel=1e-12)
    assert forces["obstacle bottom"] == pytest.approx([0, 0, 100 + 2 * WEIGHT], rel=1e-9, abs=1e-9)
    on_lower = forces["contact lower_top upper_bottom"]
    assert on_lower == pytest.approx([0, 0, -100 - WEIGHT], rel=1e-9, abs=1e-9)
    assert forces["support x0"][0] == pytest.approx(-2.0, rel=1e-8)
    assert forces["support x0"][1] + forces["support y0"][1] == pytest.approx(0, abs=1e-8)
    assert level.report.balance < 1e-10


def test_every_component_is_told_once() -> None:
    """Edges with two supports count for the first one, and the sum is right."""
    problem = two_blocks_problem(2)
    twice = Problem(
        problem.tagged_mesh,
        {"lower": STEEL, "upper": STEEL},
        [Support("left", "x"), Support("left"), Support("lower_top", "x")],
        [Pressure("top", 1.0)],
    )
    level = Newton(twice, TIGHT).solve(1.0)
    forces = level.report.reactions
    assert set(forces) == {"loads", "support left", "support lower_top"}
    assert np.sum(list(forces.values()), axis=0) == pytest.approx(0, abs=1e-10)
    assert level.report.balance < 1e-10


def solved(method: type) -> Level:
    problem = two_blocks_problem(2)
    level = Newton(problem, TIGHT).solve(150.0)
    if method is WorkNewton:
        return WorkNewton(problem, TIGHT).solve(level.state.alpha)
    if method is AugmentedLagrangian:
        return method(problem, AugmentedLagrangianOptions(tolerance=1e-11)).solve(150.0)
    return level


@pytest.mark.long(but=["Newton"])
@pytest.mark.parametrize("method", [Newton, AugmentedLagrangian, WorkNewton])
def test_levels_balance(method: type) -> None:
    level = solved(method)
    assert level.report.converged
    assert level.report.plastic_fraction > 0
    assert level.report.balance < 1e-10


def test_a_wrong_state_is_out_of_balance() -> None:
    problem = stack()
    right = Newton(problem, TIGHT).solve(100.0)
    fields = QuadratureFields(problem)
    fields.u.x.array[:] = 1.001 * right.state.u.x.array
    fields.update()
    assert certify(problem, fields, 100.0).resultants.balance > 1e-6


def test_the_weight_of_a_plate() -> None:
    """The plate is 100 by 1, without the quarter 5 by 5 of its hole."""
    plate = Problem(
        l_plate(MPI.COMM_WORLD, 1),
        {"plate": STEEL},
        [Support("x0", "x"), Support("z0", "z"), Support("z1", "z"), Support("y0", "y")],
        [BodyForce("plate", (0.0, -1.0, 0.0))],
    )
    report = Newton(plate, TIGHT).solve(0.3).report
    up = report.reactions["support y0"][1]
    assert up == pytest.approx(-report.reactions["loads"][1], rel=1e-10)
    assert report.reactions["loads"][1] == pytest.approx(-0.3 * 75.0, rel=1e-12)
