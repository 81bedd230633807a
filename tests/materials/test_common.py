"""Test common materials and soils, and numbers copied in wrong units."""

import pytest

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.materials import MohrCoulomb, VonMises
from perfplast_fenicsx.materials.common import (
    MATERIALS,
    SOILS,
    Soil,
    check_soil_units,
    check_units,
    find,
)
from perfplast_fenicsx.units import SYSTEMS

pytestmark = pytest.mark.serial


def test_each_is_a_material_with_a_source() -> None:
    assert len({one.name for one in (*MATERIALS, *SOILS)}) == len(MATERIALS) + len(SOILS)
    for one in MATERIALS:
        VonMises(one.young, one.poisson, one.yield_stress)
        assert one.what
        assert one.source
    for soil in SOILS:
        MohrCoulomb(soil.young, soil.poisson, soil.cohesion, soil.friction_angle)
        assert soil.what
        assert soil.source


def test_in_another_system() -> None:
    steel = find("S235", "m-kN-kPa")
    assert (steel.young, steel.yield_stress) == pytest.approx((210e6, 235e3))
    assert find("clay-medium", "SI").yield_stress == pytest.approx(3**0.5 * 40e3)
    with pytest.raises(InputError, match="did you mean 's2"):
        find("s253")
    clay = next(soil for soil in SOILS if soil.name == "clay-stiff-drained")
    for system, stress, weight in (("m-kN-kPa", 13.0, 19.0), ("SI", 13e3, 19e3)):
        here = clay.in_system(system)
        assert (here.cohesion, here.unit_weight) == pytest.approx((stress, weight))
        assert here.young / here.cohesion == pytest.approx(4000 / 13)
    assert clay.in_system("mm-kN-GPa").unit_weight == pytest.approx(19e-9)
    with pytest.raises(InputError, match="is ground for law = 'mohr-coulomb'"):
        find("clay-stiff-drained")


@pytest.mark.parametrize("name", [one.name for one in MATERIALS])
def test_copied_numbers(name: str) -> None:
    """The numbers are accepted in their system of units, and refused in another system."""
    for system in SYSTEMS:
        one = find(name, system)
        rounded = [float(f"{x:g}") for x in (one.young, one.poisson, one.yield_stress)]
        for other in SYSTEMS:
            if SYSTEMS[other].stress == SYSTEMS[system].stress:
                check_units(*rounded, other)
                continue
            with pytest.raises(
                InputError, match=f"values for '{name}' in {SYSTEMS[system].stress}"
            ):
                check_units(*rounded, other)


@pytest.mark.parametrize("soil", SOILS, ids=lambda soil: soil.name)
def test_copied_soils(soil: Soil) -> None:
    """The same holds for ground."""
    for system in SYSTEMS:
        one = soil.in_system(system)
        rounded = [float(f"{x:g}") for x in (one.young, one.poisson, one.cohesion)]
        for other in SYSTEMS:
            if SYSTEMS[other].stress == SYSTEMS[system].stress:
                check_soil_units(*rounded, other)
                continue
            with pytest.raises(InputError, match=f"values for '{soil.name}' in .* write young = "):
                check_soil_units(*rounded, other)


def test_other_numbers() -> None:
    check_units(210000.0, 0.3, 236.0, "SI")
    check_soil_units(4000.0, 0.3, 12.0, "SI")
