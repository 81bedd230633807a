"""Upper bounds from velocities, against exact limit loads."""

from mpi4py import MPI

import numpy as np
import pytest
from dolfinx import fem

from perfplast_fenicsx import (
    Contact,
    Elastic,
    Newton,
    Pressure,
    Problem,
    State,
    Support,
    stacked_blocks,
)
from perfplast_fenicsx.limit_analysis import kinematic_bound
from perfplast_fenicsx.limit_analysis.kinematic_bound import dissipation_bound
from tests.models import stack_problem


def sinking(problem: Problem, bend: float) -> fem.Function:
    """Blocks that are compressed and keep their volume, but for a bend."""
    v = fem.Function(problem.V)
    v.interpolate(lambda x: np.array([x[0], x[1], -2 * x[2] + bend * np.sin(9 * x[0]) * x[2]]))
    return v


def state(problem: Problem) -> State:
    return Newton(problem).solve(100.0).state


@pytest.mark.mpi3
@pytest.mark.parametrize("bend", [0.0, 0.3])
def test_a_velocity_near_a_mechanism_gives_a_bound(bend: float) -> None:
    """Both blocks yield at the pressure 300; what is bent costs more."""
    problem = stack_problem(2)
    bound = dissipation_bound(problem, sinking(problem, bend), state(problem))
    assert bound.value is not None
    assert bound.value >= 300 * (1 - 1e-9)
    if bend == 0:
        assert bound.value == pytest.approx(300.0, rel=1e-9)
    assert bound.solves >= 1


def test_bodies_that_never_yield_have_no_bound() -> None:
    problem = Problem(
        stacked_blocks(MPI.COMM_WORLD, 1),
        {"lower": Elastic(2e5, 0.3), "upper": Elastic(7e4, 0.2)},
        [Support("x0", "x"), Support("y0", "y"), Support("bottom", "z")],
        [Pressure("top", 1.0)],
        [Contact("lower_top", "upper_bottom")],
    )
    assert dissipation_bound(problem, sinking(problem, 0.0), state(problem)).value is None


def test_large_problems_have_none(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = stack_problem(2)
    monkeypatch.setattr(kinematic_bound, "LARGEST_PROBLEM", problem.num_dofs - 1)
    bound = dissipation_bound(problem, sinking(problem, 0.0), state(problem))
    assert (bound.value, bound.solves) == (None, 0)
