"""Test whether cones contain each other, against points of the cones."""

import numpy as np
import pytest

from perfplast_fenicsx.proof.cone_shapes import Strengths, are_weaker

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
        assert are_weaker(lower, upper).all()
    else:
        assert are_weaker(lower, upper)[lower.slope != upper.slope].all()
