"""Test Hooke's law, and the parameters of an elastic body."""

import math

import numpy as np
import pytest

from perfplast_fenicsx import Elastic, InputError
from tests.materials.properties import Point, check_all, strains

pytestmark = pytest.mark.serial


@pytest.mark.parametrize("gdim", [2, 3])
@pytest.mark.parametrize("material", [Elastic(10.0, -0.3), Elastic(206900.0, 0.29)])
def test_what_is_true_of_every_law(material: Elastic, gdim: int) -> None:
    check_all(material, 1e-3, gdim)


def test_it_never_yields() -> None:
    point = Point(Elastic(10.0, 0.2))
    for e in strains([1e-6, 1.0, 1e6]):
        assert np.allclose(point("stress", e), point("hooke", e), rtol=1e-13, atol=0)
        for name in ("plastic", "yield_ratio", "dissipation"):
            assert not point(name, e).any()


def test_constants_are_the_textbook_ones() -> None:
    steel = Elastic(206900.0, 0.29)
    assert steel.bulk == pytest.approx(206900 / (3 * 0.42))
    assert steel.shear == pytest.approx(206900 / 2.58)


@pytest.mark.parametrize(
    ("young", "poisson", "named"),
    [
        (0.0, 0.3, "young = 0.0"),
        (math.inf, 0.3, "young = inf"),
        (1.0, 0.5, "poisson = 0.5"),
        (1.0, -1.0, "poisson = -1.0"),
        (1.0, math.nan, "poisson = nan"),
    ],
)
def test_impossible_constants_are_named(young: float, poisson: float, named: str) -> None:
    with pytest.raises(InputError, match=named):
        Elastic(young, poisson)
