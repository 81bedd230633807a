"""Test von Mises' law without hardening, and its parameters."""

import math

import numpy as np
import pytest

from perfplast_fenicsx import InputError, VonMises
from tests.materials.properties import Point, check_all, deviator, strains

pytestmark = pytest.mark.serial

STEEL = VonMises(206900.0, 0.29, 450.0)
SOFT = VonMises(1000.0, 0.499, 2.0)


@pytest.mark.parametrize("gdim", [2, 3])
@pytest.mark.parametrize("material", [STEEL, SOFT])
def test_what_is_true_of_every_law(material: VonMises, gdim: int) -> None:
    check_all(material, material.yield_radius / (2 * material.shear), gdim)


@pytest.mark.parametrize("material", [STEEL, SOFT])
def test_stress_is_admissible_and_elastic_inside(material: VonMises) -> None:
    point = Point(material)
    for e in strains([1e-4, 3e-3, 1.0]):
        size = np.linalg.norm(deviator(point("stress", e)))
        assert size <= material.yield_radius * (1 + 1e-12)
        assert point.number("yield_ratio", point("stress", e)) <= 1 + 1e-9
        small = e * 1e-6
        elastic = point("hooke", small)
        assert np.abs(point("stress", small) - elastic).max() <= 1e-13 * np.abs(elastic).max()
        assert not point("plastic", small).any()


def test_dissipation_is_the_largest_power() -> None:
    point = Point(STEEL)
    rate = deviator(strains([1.0])[0])
    power = point.number("dissipation", rate)
    assert power == pytest.approx(STEEL.yield_radius)
    assert power == pytest.approx(float(point("stress", rate) @ rate))


def test_constants_are_the_textbook_ones() -> None:
    assert STEEL.bulk == pytest.approx(206900 / (3 * 0.42))
    assert STEEL.shear == pytest.approx(206900 / 2.58)
    assert STEEL.yield_radius == pytest.approx(math.sqrt(2 / 3) * 450)


@pytest.mark.parametrize(
    ("young", "poisson", "yield_stress", "named"),
    [
        (0.0, 0.3, 1.0, "young = 0.0"),
        (1.0, 0.5, 1.0, "poisson = 0.5"),
        (1.0, 0.3, -2.0, "yield_stress = -2.0"),
        (1.0, 0.3, math.inf, "yield_stress = inf"),
    ],
)
def test_impossible_constants_are_named(
    young: float, poisson: float, yield_stress: float, named: str
) -> None:
    with pytest.raises(InputError, match=named):
        VonMises(young, poisson, yield_stress)
