"""Test a block on a slope with Coulomb friction: rest below the friction angle, no level above."""

import math

from mpi4py import MPI

import pytest

from perfplast_fenicsx import BodyForce, Contact, Level, Newton, Problem, Support
from tests.checks import assert_solved
from tests.contact.blocks_apart import blocks_apart
from tests.models import STEEL

MU = 0.3


def on_slope(degrees: float, degree: int) -> Level:
    """Return the block under its weight, inclined this much above the friction angle."""
    angle = math.atan(MU) + math.radians(degrees)
    problem = Problem(
        blocks_apart(MPI.COMM_WORLD, [4, 2], [4, 2], moved_by=0.0),
        {"lower": STEEL, "upper": STEEL},
        [Support("bottom")],
        [BodyForce("upper", (math.sin(angle), -math.cos(angle)))],
        [Contact("lower_top", "upper_bottom", coulomb=MU)],
        degree=degree,
    )
    return Newton(problem).solve(1.0)


@pytest.mark.mpi2("-0.01-1")
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("degrees", [-0.01, -0.001])
def test_a_little_less_steep(degrees: float, degree: int) -> None:
    """The block rests, and does not jump down the slope and back."""
    level = on_slope(degrees, degree)
    assert_solved(level)
    assert level.report.friction_excess < 1e-12
    assert level.report.max_displacement < 1e-4


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("degrees", [1e-4, 0.001, 0.01])
def test_a_little_too_steep(degrees: float, degree: int) -> None:
    """The level has no equilibrium, even if only a little is missing."""
    report = on_slope(degrees, degree).report
    assert not report.converged
    assert "of Coulomb's friction" in report.reason
    assert "no equilibrium exists" in report.reason or "slide" in report.reason
