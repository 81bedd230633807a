"""Why a level has no solution: above a limit, below the other one, or by constant loads alone."""

import pytest

from perfplast_fenicsx import Iteration
from perfplast_fenicsx.solvers.verdicts import above_limit

pytestmark = pytest.mark.serial

STEPS = [
    Iteration(i, 1.0, alpha, -alpha, 0.1, 1.0, 0.0, 0.5, 0, 1, 0, 0.1)
    for i, alpha in enumerate((1.0, 50.0), start=1)
]


@pytest.mark.parametrize(
    ("zeta", "grows", "words"),
    [
        (2.0, True, "at ζ = 2, it is above the limit load: J_ζ fell from -1 to -50"),
        (-2.0, True, "at ζ = -2, it is below the lower limit load: J_ζ fell"),
        (0.0, True, "the constant loads alone are above what the bodies carry: at ζ = 0"),
        (2.0, False, "the constant loads alone are above what the bodies carry: at ζ = 2"),
    ],
)
def test_which_limit(zeta: float, grows: bool, words: str) -> None:
    assert words in above_limit(zeta, STEPS, grows)
