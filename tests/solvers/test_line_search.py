"""Test step lengths along a convex energy, and Newton steps of bodies that yield."""

import numpy as np
import pytest

from perfplast_fenicsx import Newton
from perfplast_fenicsx.solvers.iterate import LONGEST, SLOPE_REDUCTION, STRETCHABLE, step_length
from tests.models import l_plate_problem


def exact() -> tuple[float, float]:
    return 0.0, 0.0


def noisy() -> tuple[float, float]:
    return 1e-3, 10.0


def longest() -> float:
    return LONGEST


def falls_on(beta: float) -> float:
    return beta**2 - 2.0


def test_a_step_is_shortened_to_where_the_energy_is_least() -> None:
    beta = step_length(lambda b: b**2 - 0.09, exact, longest)
    assert abs(beta**2 - 0.09) <= SLOPE_REDUCTION * 0.09


def test_a_step_is_stretched_where_the_energy_falls_on() -> None:
    beta = step_length(falls_on, exact, longest)
    assert beta > 1
    assert abs(falls_on(beta)) <= STRETCHABLE * 2.0
    assert step_length(lambda b: b - 10.0, exact, longest) == pytest.approx(LONGEST)


def test_a_step_is_not_stretched_where_nothing_is_gained_or_it_may_not_be() -> None:
    for slope, noise, most in (
        (falls_on, exact, None),
        (falls_on, exact, lambda: 0.7),
        (falls_on, noisy, longest),
        (lambda b: b - 1.05, exact, longest),
    ):
        assert step_length(slope, noise, most) == pytest.approx(1.0)


def test_a_step_is_not_shortened_for_rounding_errors() -> None:
    assert step_length(lambda b: b**2 - 0.09, noisy, longest) == pytest.approx(1.0)


def test_steps_of_yielding_bodies_are_stretched_and_the_last_one_is_not() -> None:
    level = Newton(l_plate_problem(2)).solve(1.0)
    energies = [step.energy for step in level.iterations]
    assert level.report.converged
    assert max(step.beta for step in level.iterations) > 1
    assert level.iterations[-1].beta == pytest.approx(1.0)
    assert (np.diff(energies) <= 1e-12 * abs(energies[-1])).all()


def test_a_step_up_is_not_taken_where_there_are_kinks() -> None:
    """A wrong linearisation of friction would push bodies along such steps."""
    assert step_length(lambda b: b + 0.5, exact, None, kinked=True) == pytest.approx(0.0)
    assert step_length(lambda b: b - 2.0, exact, None, kinked=True) == pytest.approx(1.0)
    assert step_length(lambda b: b + 0.5, noisy, None, kinked=True) == pytest.approx(1.0)


def test_a_step_on_which_bodies_slide_goes_on_until_a_surface_resists() -> None:
    """φ' is constant up to the point where slip reverses, which may be far away."""

    def sliding(beta: float) -> float:
        return -1.0 if beta < 300.0 else 1.0

    def far() -> float:
        return 1e4

    assert step_length(sliding, exact, far, kinked=True) == pytest.approx(300.0, rel=1e-6)
    assert step_length(sliding, exact, lambda: 100.0, kinked=True) == pytest.approx(100.0)
    assert step_length(lambda b: b - 2.0, exact, far, kinked=True) == pytest.approx(1.0)
