"""Test consistent systems of units."""

import pytest

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.units import SYSTEMS, Units

pytestmark = pytest.mark.serial

NEWTONS = {"N": 1.0, "kN": 1e3, "MN": 1e6, "lbf": 4.4482216152605, "kip": 4448.2216152605}
METRES = {"mm": 1e-3, "m": 1.0, "in": 0.0254, "ft": 0.3048}


@pytest.mark.parametrize("name", SYSTEMS)
def test_systems_are_consistent(name: str) -> None:
    system = SYSTEMS[name]  # type: ignore[index]
    assert system.metres == METRES[system.length]
    assert system.pascals * system.metres**2 == pytest.approx(NEWTONS[system.force], rel=1e-14)
    assert name == "SI" or name == f"{system.length}-{system.force}-{system.stress}"


def test_stresses_in_pounds() -> None:
    """Factors to SI come from NIST SP 811 (2008), appendix B.8."""
    factors = {"psi": 6894.757, "ksi": 6894757.0, "psf": 47.88026, "ksf": 47880.26}
    assert {
        system.stress: pytest.approx(system.pascals, rel=1e-7)
        for system in SYSTEMS.values()
        if system.force in ("lbf", "kip")
    } == factors


def test_units_of_quantities() -> None:
    space, plane = (Units(system="mm-N-MPa").table(whole) for whole in (True, False))
    assert space == {
        **{"system": "mm-N-MPa", "length": "mm", "volume": "mm^3"},
        **{"stress": "MPa", "force": "N"},
        **{"work": "N mm", "moment": "N m", "force_density": "N/mm^3"},
    }
    assert plane["moment"] == "N m/m"
    assert (plane["force"], plane["work"]) == ("N/mm", "N mm/mm")
    assert plane["volume"] == "mm^3/mm"
    assert Units("m", "kPa").name == "m-kN-kPa"
    assert Units("m", "kPa").table() == Units(system="m-kN-kPa").table()


@pytest.mark.parametrize("name", SYSTEMS)
def test_moments_have_arms_in_metres_or_feet(name: str) -> None:
    """A unit force with an arm of one metre or foot has the moment 1 in the reported unit."""
    units, system = Units(system=name), SYSTEMS[name]  # type: ignore[arg-type, index]
    arm = "ft" if system.length in ("in", "ft") else "m"
    arm_as_given = METRES[arm] / system.metres  # one metre or foot in the length unit of the case
    assert units.moment_scale() * arm_as_given == pytest.approx(1.0, rel=1e-14)
    assert units.table()["moment"] == f"{units.table()['force']} {arm}"
    assert units.moment_scale(whole=False) == Units("cm", "bar").moment_scale() == 1.0


def test_units_of_no_system() -> None:
    other = Units("cm", "bar")
    assert (other.name, other.of_work(whole=True)) == (None, "bar cm³")
    assert (other.table()["force"], other.table(whole=False)["work"]) == ("bar cm²", "bar cm²")
    assert set(Units().table().values()) == {""}
    assert Units().in_words() == Units("mm").of_work(whole=True) == ""
    assert Units("mm").in_words() == "lengths in mm"
    assert Units().of_stress() == "the materials' unit of stress"


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"length": "m"}, "length = 'm' contradicts system = 'mm-N-MPa',"),
        ({"stress": "kPa"}, "stress = 'kPa' contradicts"),
    ],
)
def test_contradictions(given: dict[str, str], says: str) -> None:
    with pytest.raises(InputError, match=says):
        Units(system="mm-N-MPa", **given)


def test_no_such_system() -> None:
    with pytest.raises(InputError, match="system = 'mm-t-s' is unknown;"):
        Units(system="mm-t-s")  # type: ignore[arg-type]
