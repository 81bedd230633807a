"""Test that a printed bound is still a bound after rounding."""

import numpy as np
import pytest

from perfplast_fenicsx.rounding import rounded_down, rounded_up

pytestmark = pytest.mark.serial


@pytest.mark.parametrize(
    ("value", "down", "up"),
    [
        (519.61524, "519.615", "519.616"),
        (100.0, "100", "100"),
        (-1.23456789, "-1.23457", "-1.23456"),
        (9999999.0, "9.99999e+06", "1e+07"),
    ],
)
def test_a_bound_in_a_few_digits(value: float, down: str, up: str) -> None:
    assert (rounded_down(value), rounded_up(value)) == (down, up)


def test_any_number() -> None:
    random = np.random.default_rng(1)
    for value in random.normal(size=500) * 10.0 ** random.integers(-9, 9, 500):
        low, high = float(rounded_down(value)), float(rounded_up(value))
        assert low <= value <= high
        assert high - low <= 2e-5 * abs(value)
