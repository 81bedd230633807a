"""Test the laws with a tensile strength: projections on a pyramid with a cut-off top."""

import math

import numpy as np
import pytest

from perfplast_fenicsx import InputError, MohrCoulomb, Tresca
from perfplast_fenicsx.arrays import matrices, vectors
from perfplast_fenicsx.materials.mohr_coulomb import MohrCoulombLaw
from tests.materials.properties import Array, Point, check_all

pytestmark = pytest.mark.serial

GROUND = MohrCoulomb(1e4, 0.3, 10.0, 20.0, tensile_strength=4.0)
METAL = Tresca(1e4, 0.3, 10.0, tensile_strength=3.0)


@pytest.mark.long(but=["material1-2"])
@pytest.mark.parametrize(("material", "gdim"), [(GROUND, 3), (METAL, 2)])
def test_what_is_true_of_every_law(material: MohrCoulomb | Tresca, gdim: int) -> None:
    check_all(material, 0.1 * material.cohesion / material.shear, gdim)


def principal(stress: Array) -> Array:
    """Return the principal values, the largest first."""
    return np.linalg.eigvalsh(matrices(stress))[::-1]


def test_stress_is_the_nearest_admissible_one() -> None:
    """Random principal strains satisfy the variational inequality; all vertices and edges occur."""
    point, numbers = Point(GROUND), GROUND.parameters()
    s, b, f = (numbers[name] for name in ("sine", "strength", "tension"))
    low = ((1 + s) * f - b) / (1 - s)
    corners = [(f, f, f), (f, f, low), (f, low, low), (-100.0,) * 3]
    random, found = np.random.default_rng(5), set()
    turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
    for number in range(300):
        values = 2e-3 * random.normal(size=3)
        if number % 10 == 0:
            values = abs(values) * (2, -1, -1)
        e = vectors(turn @ np.diag(values) @ turn.T)
        stress, trial = point("stress", e), point("hooke", e)
        most, middle, least = principal(stress)
        over = max((1 + s) * most - (1 - s) * least - b, most - f)
        assert over <= 1e-11
        lost = point("compliance", trial - stress)
        for corner in corners:
            other = vectors(turn @ np.diag(corner) @ turn.T)
            assert (other - stress) @ lost <= 1e-12
        tops = [int(abs(value - f) < 1e-9) for value in (most, middle, least)]
        found.add((*tops, abs(least - low) < 1e-9, abs(middle - low) < 1e-9))
    kinds = {(1, 0, 0), (1, 1, 0), (1, 1, 1)}
    assert kinds <= {of[:3] for of in found}
    assert {(1, 0, 0, True, False), (1, 1, 0, True, False), (1, 0, 0, True, True)} <= found


def test_a_strength_beyond_the_apex_is_none() -> None:
    apex = 10 / math.tan(math.radians(20))
    assert MohrCoulomb(1e4, 0.3, 10.0, 20.0, tensile_strength=apex).law is MohrCoulombLaw


def test_it_falls_with_the_others() -> None:
    ground, metal = GROUND.divided_by(2.0), METAL.divided_by(2.0)
    assert (ground.tensile_strength, metal.tensile_strength) == pytest.approx((2.0, 1.5))


@pytest.mark.parametrize("given", [0.0, -1.0, math.nan, math.inf])
def test_what_is_no_strength_is_named(given: float) -> None:
    with pytest.raises(InputError, match=r"tensile_strength.*not a positive"):
        Tresca(1e4, 0.3, 10.0, tensile_strength=given)
    with pytest.raises(InputError, match="radenkovic"):
        MohrCoulomb(1e4, 0.3, 10.0, 20.0, 0.0, 10.0, "radenkovic", tensile_strength=1.0)
