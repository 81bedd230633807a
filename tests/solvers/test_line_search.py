"""Lengths of steps along a convex energy, and of Newton steps of bodies that yield."""

import numpy as np
import pytest

from perfplast_fenicsx import Newton
from perfplast_fenicsx.solvers.line_search import LONGEST, STRETCHABLE, shortened, stretched
from tests.models import l_plate_problem


def test_a_step_is_shortened_to_where_the_energy_is_least() -> None:
    assert shortened(lambda beta: beta**2 - 0.09, 1e-9) == pytest.approx(0.3, abs=1e-8)


def test_a_step_is_stretched_where_the_energy_falls_on() -> None:
    def slope(beta: float) -> float:
        return beta**2 - 2.0

    beta = stretched(slope, slope(0.0), slope(1.0), LONGEST)
    assert beta > 1
    assert abs(slope(beta)) <= STRETCHABLE * 2.0
    blocked = stretched(slope, slope(0.0), slope(1.0), 1.0)
    assert blocked == pytest.approx(1.0)
    assert stretched(lambda b: b - 10.0, -10.0, -9.0, 1.5) == pytest.approx(1.5)


def test_a_step_that_ends_near_the_least_energy_is_taken_as_it_is() -> None:
    assert stretched(lambda b: b - 1.05, -1.05, -0.05, LONGEST) == pytest.approx(1.0)


def test_steps_of_yielding_bodies_are_stretched_and_the_last_one_is_not() -> None:
    level = Newton(l_plate_problem(2)).solve(1.0)
    energies = [step.energy for step in level.iterations]
    assert level.report.converged
    assert max(step.beta for step in level.iterations) > 1
    assert level.iterations[-1].beta == pytest.approx(1.0)
    assert (np.diff(energies) <= 1e-12 * abs(energies[-1])).all()
