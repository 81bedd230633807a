"""Test that a law from outside the package derives from a potential, like all laws."""

import math

import numpy as np
import pytest

from tests.materials.energy_cap import Foam
from tests.materials.properties import Point, check_all, strains

pytestmark = pytest.mark.serial


@pytest.mark.parametrize("gdim", [2, 3])
@pytest.mark.parametrize("centre", [0.0, 3.0])
def test_potential_tangent_and_conjugate(centre: float, gdim: int) -> None:
    material = Foam(1e4, 0.3, 10.0, centre)
    check_all(material, 10.0 / 1e4 / 4, gdim)


def test_stress_is_on_the_surface_where_it_flows() -> None:
    point = Point(Foam(1e4, 0.3, 10.0, 3.0))
    for e in strains([1e-2, 1.0]):
        assert point.number("yield_ratio", point("stress", e)) == pytest.approx(1, rel=1e-12)


def test_pressure_alone_makes_it_yield() -> None:
    material = Foam(1e4, 0.3, 10.0, 3.0)
    least = math.sqrt(material.parameters()["bulk"] * material.parameters()["energy"])
    even = np.array([1.0, 1, 1, 0, 0, 0])
    for pressure in (least + 3.0, 3.0 - least):
        assert Point(material).number("yield_ratio", -pressure * even) == pytest.approx(1)
