"""Test the reserve with constant loads, and the mean of admissible and inadmissible stresses."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from perfplast_fenicsx.limit_analysis.conic.conic_program import RESERVES, Start
from perfplast_fenicsx.limit_analysis.stress.static_bound import BalancedStress

pytestmark = pytest.mark.serial


def of_sizes(stress: tuple[np.ndarray, np.ndarray]) -> float:
    """Return ‖s‖ at points with the yield radius 1."""
    return float(np.linalg.norm(stress[1], axis=1).max())


STATIC: Any = SimpleNamespace(program=SimpleNamespace(stress_unit=2.0, overstress=of_sizes))
"""Yield radii of 2."""


def stress(size: float, load: float) -> BalancedStress:
    """Return the stress at one of three points; the other points have less."""
    deviator = np.array([[size, 0.0], [0.0, 0.5 * size], [0.0, 0.0]])
    return BalancedStress(np.arange(3.0), deviator, load, 0.1 * load)


def test_some_of_a_stress_inside_brings_one_back() -> None:
    inside, outside = stress(1.8, 5.0), stress(2.1, 6.0)
    found = inside.with_some_of([outside], STATIC)
    assert found.over(STATIC) <= 0
    assert found.load == pytest.approx(5 + 2 / 3, rel=1e-3)
    assert found.aside == pytest.approx(0.1 * found.load)
    assert found.pressure == pytest.approx(np.arange(3.0))


def test_a_stress_that_is_outside_or_carries_less_helps_nobody() -> None:
    inside, outside = stress(1.8, 5.0), stress(2.1, 6.0)
    assert outside.with_some_of([stress(2.2, 7.0)], STATIC) is outside
    assert inside.with_some_of([stress(2.1, 4.0)], STATIC) is inside
    assert inside.with_some_of([], STATIC) is inside


def test_more_is_kept_by_what_has_been_missing() -> None:
    least, unknown, most = RESERVES
    start = Start()
    assert start.reserve == least
    more = start.with_more_in_reserve(2e-4)
    assert more is not None
    assert more.reserve == pytest.approx(least + 3e-4)
    assert start.with_more_in_reserve(1e-9) == Start(reserve=3 * least)
    assert start.with_more_in_reserve() == Start(reserve=10 * least)
    assert start.with_more_in_reserve(1.0) == Start(reserve=most)
    assert Start(reserve=most).with_more_in_reserve(1.0) is None
    assert Start(reserve=unknown).with_more_in_reserve() is None
    assert Start(reserve=unknown).with_more_in_reserve(1e-3) == Start(reserve=3 * unknown)
