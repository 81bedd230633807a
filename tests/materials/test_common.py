"""Common materials, and numbers that were copied in the wrong units."""

import pytest

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.materials import VonMises
from perfplast_fenicsx.materials.common import MATERIALS, check_units, find
from perfplast_fenicsx.units import SYSTEMS

pytestmark = pytest.mark.serial


def test_each_is_a_material_with_a_source() -> None:
    assert len({one.name for one in MATERIALS}) == len(MATERIALS)
    for one in MATERIALS:
        VonMises(one.young, one.poisson, one.yield_stress)
        assert one.what
        assert one.source


def test_in_another_system() -> None:
    steel = find("S235", "m-kN-kPa")
    assert (steel.young, steel.yield_stress) == pytest.approx((210e6, 235e3))
    assert find("clay-medium", "SI").yield_stress == pytest.approx(3**0.5 * 40e3)
    with pytest.raises(InputError, match="did you mean 's2"):
        find("s253")


@pytest.mark.parametrize("name", [one.name for one in MATERIALS])
def test_copied_numbers(name: str) -> None:
    """They are right in their own system, and in another one they are refused."""
    for system in SYSTEMS:
        one = find(name, system)
        rounded = [float(f"{x:g}") for x in (one.young, one.poisson, one.yield_stress)]
        for other in SYSTEMS:
            if SYSTEMS[other].stress == SYSTEMS[system].stress:
                check_units(*rounded, other)
                continue
            with pytest.raises(InputError, match=f"those of '{name}' in {SYSTEMS[system].stress}"):
                check_units(*rounded, other)


def test_other_numbers() -> None:
    check_units(210000.0, 0.3, 236.0, "SI")
