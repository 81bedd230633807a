"""Test the text that compares the limit load with a design load."""

import math

import pytest

from perfplast_fenicsx import InputError
from perfplast_fenicsx.limit_analysis.statements.load_factor import DesignFactor, check_design

pytestmark = pytest.mark.serial


@pytest.mark.parametrize(
    ("lower", "upper", "estimate", "words"),
    [
        (3.0, 4.0, 3.9, ["is carried for certain", "1.5 times", "50 %", "2 times it is not."]),
        (3.0, None, 3.9, ["is carried for certain", "1.5 times", "50 % to spare."]),
        (1.0, 1.5, 1.4, ["is not carried", "at 0.75 times"]),
        (1.0, 3.0, 2.9, ["not decided", "0.5 times it is carried", "1.5 times it is not"]),
        (None, None, 2.9, ["not decided", "nothing is proven", "(estimate: 1.45 times)"]),
        (None, 4.0, None, ["not decided", "2 times it is not."]),
    ],
)
def test_words(
    lower: float | None, upper: float | None, estimate: float | None, words: list[str]
) -> None:
    said = DesignFactor.of(2.0, lower, upper, estimate).in_words()
    assert [part for part in words if part not in said] == []


def test_rounding_is_to_the_safe_side() -> None:
    words = DesignFactor.of(3.0, 4.0, 5.0, None).in_words()
    assert "1.33333 times: the proof leaves 33 % to spare; 1.66667 times it is not" in words
    assert "leaves 9.9 % to spare" in DesignFactor.of(1.0, 1.0999, None, None).in_words()
    assert "leaves 640 % to spare" in DesignFactor.of(1.0, 7.49998, None, None).in_words()
    assert "leaves 0 % to spare" in DesignFactor.of(2.0, 2.0, None, None).in_words()


@pytest.mark.parametrize("design", [0.0, -1.0, math.inf, math.nan])
def test_what_is_no_load_factor(design: float) -> None:
    with pytest.raises(InputError, match=r"^design = "):
        check_design(design)
