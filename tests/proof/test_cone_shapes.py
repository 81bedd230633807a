"""Test whether cones contain each other, against points of the cones."""

import numpy as np
import pytest

from perfplast_fenicsx.proof.body import Body
from perfplast_fenicsx.proof.cone_shapes import Strengths, are_weaker, strengths_of
from tests.proof.forging import Arrays
from tests.proof.test_balance import strip

N = 400


def cones(rng: np.random.Generator, axial: bool) -> Strengths:
    """Return cones r ≤ c − αp about one axis, some with zero or equal slopes, or c = 0."""
    slope = rng.choice([0.0, 0.2, 0.5, 1.0], N)
    bound = rng.choice([0.0, 1.0, 2.0, 3.0, np.inf], N)
    return Strengths(np.zeros(N, dtype=np.int64), slope, bound, np.full(N, axial))


def test_what_holds_is_held_at_points() -> None:
    rng = np.random.default_rng(3)
    lower, upper = cones(rng, True), cones(rng, True)
    weaker = are_weaker(lower, upper)
    assert 0.2 < weaker.mean() < 0.8
    p = np.linspace(-1e3, 1e3, 20_001)
    for i in range(N):
        room = lower.bound[i] - lower.slope[i] * p
        inside = room >= 0
        held = (room <= upper.bound[i] - upper.slope[i] * p + 1e-9)[inside].all()
        if not weaker[i]:
            assert held
        elif 0 < lower.bound[i] and np.isfinite(lower.bound[i]) and np.isfinite(upper.bound[i]):
            assert not held or lower.slope[i] == 0 < upper.slope[i]


@pytest.mark.parametrize("apart", ["axial", "family"])
def test_other_shapes_are_not_known(apart: str) -> None:
    rng = np.random.default_rng(3)
    lower, upper = cones(rng, apart != "axial"), cones(rng, True)
    if apart == "family":
        upper = upper._replace(family=upper.family + 1)
        unlike = np.ones(N, dtype=bool)
    else:
        unlike = lower.slope != upper.slope
    elastic = np.isinf(upper.bound) & (upper.slope == 0)
    assert are_weaker(lower, upper)[unlike & ~elastic].all()
    assert not are_weaker(lower, upper)[elastic].any()


def principal(tension: float) -> Arrays:
    """Return a square whose cone bounds principal stresses, with c = 1 and a tensile strength."""
    them = strip(1.0, 1)
    them |= {"cone_matrix": 0 * them["cone_matrix"], "cone_sine": np.array([0.0])}
    return them | {"cone_bound": np.ones(1), "cone_tension": np.array([tension])}


def round_cone(strong: float, slope: float) -> Arrays:
    """Return a square whose cone has strengths of 1 and more, and a slope along the largest one."""
    them = strip(1.0, 1)
    them |= {"cone_matrix": np.diag([1.0, 1.0, 1 / strong])[None], "cone_bound": np.ones(1)}
    return them | {"cone_slope": np.array([[0.0, 0.0, slope]])}


def tilted(tilt: float) -> Arrays:
    """Return a square with pressure-independent strength, except for a tilt of the null vector."""
    along = np.array([np.sqrt(0.5), np.sqrt(0.5), tilt]) / np.sqrt(1 + tilt**2)
    them = round_cone(1.0, 0.0)
    return them | {"cone_matrix": (np.eye(3) - np.outer(along, along))[None]}


def steep_cone(tilt: float) -> Arrays:
    """Return a square whose cone narrows by 1e12 per unit of tension, along a tilted direction."""
    along = np.array([1 + tilt, 1 - tilt, 0.0]) * 1e12 * np.sqrt(0.5)
    return tilted(0.0) | {"cone_slope": along[None]}


LARGE = [
    (principal(np.nan), principal(1e12)),
    (principal(2e12), principal(1e12)),
    (round_cone(5e5, 0.0), round_cone(1e5, 0.0)),
    (round_cone(np.inf, 2e-12), round_cone(np.inf, 4e-12)),
    (tilted(1.5e-12), tilted(0.0)),
    (tilted(-2e-14), tilted(0.0)),
    (steep_cone(0.0), steep_cone(9e-13)),
]
"""Pairs of bodies: tensile strengths, strengths of one stress component, apexes or axes differ."""


@pytest.mark.parametrize(("lower", "upper"), LARGE)
def test_large_strengths_are_compared(lower: Arrays, upper: Arrays) -> None:
    """The strengths of both cones differ where they are 1e5 to 1e14 times as large as the least."""
    for pair, weak in (((lower, upper), True), ((lower, lower), False), ((upper, upper), False)):
        assert are_weaker(*strengths_of(*(Body.of(of) for of in pair))).all() == weak


def test_rounding_is_no_difference_of_shapes() -> None:
    """A factor for M, a rotation of its rows, and the rounding of a direction change no shape."""
    random = np.random.default_rng(5)
    turn = np.linalg.qr(random.standard_normal((3, 3)))[0]
    one = tilted(0.0) | {"cone_slope": np.array([[0.1, 0.1, 0.0]])}
    for size in 10 ** random.uniform(-6, 6, 50):
        matrix, slope = size * turn @ one["cone_matrix"], size * one["cone_slope"]
        other = one | {"cone_matrix": matrix, "cone_slope": slope, "cone_bound": np.array([size])}
        assert not are_weaker(*strengths_of(Body.of(one), Body.of(other))).any()
