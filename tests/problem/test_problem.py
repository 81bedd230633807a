"""Test input that a problem refuses."""

import math

import pytest

from perfplast_fenicsx import BodyForce, Pressure, Support, Traction
from tests.checks import assert_refused
from tests.models import STEEL, touching_blocks


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"materials": {"lower": STEEL}}, ["volume 'upper' has no material", "lower, upper"]),
        ({"materials": {"lowr": STEEL}}, ["'lowr'", "lower, upper"]),
        ({"loads": []}, ["no load"]),
        ({"loads": [Pressure("top", math.nan)]}, ["pressure on 'top'", "nan"]),
        ({"loads": [Pressure("top", 0.0)]}, ["no work"]),
        ({"loads": [Traction("top", (1.0, 2.0))]}, ["traction on 'top'", "3 finite numbers"]),
        ({"loads": [Traction("tip", (1.0, 2.0, 0.0))]}, ["'tip'", "lower_top"]),
        ({"loads": [BodyForce("top", (1.0, 2.0, 0.0))]}, ["'top'", "lower, upper"]),
        ({"supports": [Support("bottom", "w")]}, ["'w'", "'bottom'", "xyz"]),
    ],
)
def test_what_does_not_fit_is_refused_in_a_sentence(
    changes: dict[str, object], words: list[str]
) -> None:
    assert_refused(lambda: touching_blocks(**changes), words)
