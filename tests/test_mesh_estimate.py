"""Test the words on the limit load of a mesh: it is an estimate, not a bound."""

import pytest

from perfplast_fenicsx.outcome_words import MeshEstimate, percent

pytestmark = pytest.mark.serial


@pytest.mark.parametrize(
    ("static", "estimate", "kinematic", "words"),
    [
        (
            *(16.3187, 16.3791, 16.4396),
            "16.38 (static and kinematic sides 0.74 % apart), an estimate for the body, "
            "not a bound",
        ),
        (
            *(26.619351, 26.619352, 26.619353),
            "26.62 (static and kinematic sides less than 0.001 % apart), an estimate for the body, "
            "not a bound",
        ),
        (
            98.7951,
            98.7951,
            None,
            "98.8 (only the static side is known), an estimate for the body, not a bound",
        ),
        (
            1.5,
            2.0,
            2.5,
            "2 (static and kinematic sides 67 % apart), an estimate for the body, not a bound",
        ),
        (1.5, None, None, "not found, but at least 1.5 on this mesh"),
        (1.5, None, 2.5, "not found, but at least 1.5 and at most 2.5 on this mesh"),
        (0.0, None, None, "not found"),
        (
            0.0,
            2.0,
            2.0,
            "2 (only the kinematic side is known), an estimate for the body, not a bound",
        ),
    ],
)
def test_in_words(
    static: float, estimate: float | None, kinematic: float | None, words: str
) -> None:
    assert MeshEstimate(static, estimate, kinematic).in_words() == words


def test_sides_that_are_apart_take_a_digit() -> None:
    assert MeshEstimate(16.3, 16.45678, 16.5).shown == "16.5"
    assert MeshEstimate(16.45, 16.45678, 16.46).shown == "16.46"


def test_a_distance_is_told_in_two_digits() -> None:
    assert [percent(a) for a in (0.5, 0.00741, 1.23e-5, 9e-6, 0.0)] == [
        *("50 %", "0.74 %", "0.0012 %", "less than 0.001 %", "less than 0.001 %")
    ]
