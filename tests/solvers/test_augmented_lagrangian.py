"""Test ALG2: penalty, relaxation, options."""

import math

import pytest

from perfplast_fenicsx import InputError, Newton
from perfplast_fenicsx.solvers.augmented_lagrangian import (
    AugmentedLagrangian,
    AugmentedLagrangianOptions,
)
from tests.models import PUNCH_LIMIT, l_plate_problem, punch_problem, two_blocks_problem
from tests.solvers.levels import PLATE_LIMIT, SERIAL, TIGHT, converged, stress_distance

FIXED = (0.1, 1.0, 10.0)


@pytest.mark.long(but=["punch-none"])
@SERIAL
@pytest.mark.parametrize("acceleration", ["none", "anderson"])
@pytest.mark.parametrize("name", ["punch", "plate"])
def test_adaptive_penalty_is_nearly_the_best(name: str, acceleration: str) -> None:
    """Iterations are at most twice those of the best fixed r."""
    problem, limit = {
        "punch": lambda: (punch_problem(4), PUNCH_LIMIT),
        "plate": lambda: (l_plate_problem(1), PLATE_LIMIT),
    }[name]()
    most = 1500

    def iterations(penalty: float | str, zeta: float, most: int) -> int:
        options = AugmentedLagrangianOptions(
            penalty=penalty,  # type: ignore[arg-type]
            acceleration=acceleration,  # type: ignore[arg-type]
            tolerance=1e-6,
            max_iterations=most,
        )
        level = AugmentedLagrangian(problem, options).solve(zeta)
        return level.report.newton_iterations if level.report.converged else most + 1

    for share in (0.3, 0.6, 0.9, 0.98):
        adaptive = iterations("adaptive", share * limit, most)
        assert adaptive <= most
        # a fixed r with this number of iterations is not better
        best = min(iterations(r, share * limit, adaptive) for r in FIXED)
        assert adaptive <= 2 * best, (share, adaptive, best)


@pytest.mark.mpi2
def test_relaxation_leads_to_the_same_state() -> None:
    problem = two_blocks_problem(2)
    known = Newton(problem, TIGHT).solve(200.0)
    for relaxation in (0.7, 1.6):
        options = AugmentedLagrangianOptions(relaxation=relaxation, tolerance=1e-8)
        [level] = converged([AugmentedLagrangian(problem, options).solve(200.0)])
        assert stress_distance(problem, known.state, level.state) < 1e-6
        last = level.iterations[-1]
        assert last.increment == pytest.approx(max(last.extra["primal"], last.extra["dual"]))
        assert last.increment < 1e-8
        assert last.extra["penalty"] > 0


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"penalty": 0}, "penalty = 0"),
        ({"penalty": -1.0}, "penalty = -1.0"),
        ({"penalty": math.inf}, "penalty = inf"),
        ({"penalty": math.nan}, "penalty = nan"),
        ({"penalty": "auto"}, "'auto'"),
        ({"relaxation": 0.0}, "relaxation = 0.0"),
        ({"relaxation": 2.0}, "relaxation = 2.0"),
        ({"acceleration": "nesterov"}, "none, anderson"),
        ({"tolerance": 0.0}, "tolerance = 0.0"),
        ({"tolerance": 1.0}, "tolerance = 1.0"),
        ({"max_iterations": 0}, "max_iterations = 0"),
    ],
)
def test_options_out_of_range_are_refused(values: dict[str, object], words: str) -> None:
    with pytest.raises(InputError) as refusal:
        AugmentedLagrangianOptions(**values)  # type: ignore[arg-type]
    sentence = str(refusal.value)
    assert words in sentence
    assert "\n" not in sentence
    assert sentence.endswith(".")
