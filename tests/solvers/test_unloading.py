"""Test surfaces with friction, pressed and completely unloaded in stages."""

from typing import Any

from mpi4py import MPI

import pytest

from perfplast_fenicsx import Contact, Newton, Pressure, Problem, Support
from perfplast_fenicsx.materials import Flow
from perfplast_fenicsx.problem import LoadingHistory, Stage
from perfplast_fenicsx.solvers import stage_path
from tests.checks import assert_solved
from tests.contact.blocks_apart import blocks_apart
from tests.models import STEEL


@pytest.mark.long(but=["friction0-1"])
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("friction", [{"coulomb": 0.3}, {"tresca": 5.0}, {}])
def test_elastic_bodies_are_unloaded(friction: dict[str, Any], degree: int) -> None:
    """Contact forces may be rounding errors, which decide nothing and limit no friction."""
    problem = Problem(
        blocks_apart(MPI.COMM_WORLD, [4, 4], [4, 4], moved_by=0.0),
        {"lower": Flow(STEEL), "upper": Flow(STEEL)},
        [Support("bottom"), Support("upper_x0", "x")],
        [Pressure("top", 1.0, name="press")],
        [Contact("lower_top", "upper_bottom", **friction)],
        degree=degree,
    )
    history = LoadingHistory(problem, [Stage({"press": 100.0}), Stage({"press": 0.0}, steps=2)])
    levels = list(stage_path(Newton(problem), history))
    assert len(levels) == 3
    for level in levels:
        assert_solved(level)
    pressed, _, unloaded = levels
    if "tresca" in friction:  # holds without pressure
        return
    assert unloaded.report.max_displacement < 1e-12 * pressed.report.max_displacement
