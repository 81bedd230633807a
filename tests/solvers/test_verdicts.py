"""Test why a level has no solution: above or below a limit, or because of constant loads."""

from dataclasses import replace

import pytest

from perfplast_fenicsx import Iteration
from perfplast_fenicsx.solvers.verdicts import above_limit, no_convergence

pytestmark = pytest.mark.serial

STEPS = [
    Iteration(i, 1.0, alpha, -alpha, 0.1, 1.0, 0.0, 0.5, 0, 1, 0, 0.1)
    for i, alpha in enumerate((1.0, 50.0), start=1)
]


@pytest.mark.parametrize(
    ("zeta", "grows", "words"),
    [
        (2.0, True, "ζ = 2, which is above"),
        (-2.0, True, "ζ = -2, which is below"),
        (0.0, True, "the constant loads alone: at ζ = 0"),
        (2.0, False, "the constant loads alone: at ζ = 2"),
    ],
)
def test_which_limit(zeta: float, grows: bool, words: str) -> None:
    assert words in above_limit(zeta, STEPS, grows)


def test_work_that_has_grown_without_an_end_is_told() -> None:
    assert no_convergence(60, "Newton steps", STEPS) == "no convergence in 60 Newton steps"
    grown = [STEPS[0], replace(STEPS[1], alpha=5000.0)]
    assert "grew from 1 to 5000; this suggests" in no_convergence(60, "steps", grown)
