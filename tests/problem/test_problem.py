"""Test the declared data of a problem, and input that it refuses."""

import math

import pytest

from perfplast_fenicsx import (
    BodyForce,
    Contact,
    Pressure,
    Problem,
    RigidSurface,
    Support,
    Tie,
    Traction,
)
from tests.checks import assert_refused
from tests.models import STEEL, touching_blocks
from tests.solvers.test_bolts import bolted


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


def test_rigid_surfaces_and_ties_may_stand_anywhere_in_their_lists() -> None:
    """Supports come before rigid surfaces in results, in any order of the list."""
    held = [Support("x0", "x"), Support("y0", "y"), Support("bottom", "z")]
    plate = RigidSurface("top", held="xy")
    contact, tie = Contact("seat", "sleeve_top"), Tie("under_head", "bolt_top")
    first = bolted(supports=[plate, *held], contacts=[tie, contact])
    assert first.given == bolted(supports=[*held, plate], contacts=[contact, tie]).given
    assert first.given.holding == [*held, plate]
    assert first.support_names[-1] == "rigid surface top"
    assert first.given.contacts == [contact]
    assert first.given.ties == [tie]
    assert Problem.from_given(first.tagged_mesh, first.given).given == first.given
