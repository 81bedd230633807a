"""List common materials and soils as starting values, in any system of units.

For a design, take the numbers of materials from the applicable standard, and the numbers of soils
from soil tests at the site.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from perfplast_fenicsx.errors import InputError, nearest
from perfplast_fenicsx.units import SYSTEMS, Name

TABLE: Name = "mm-N-MPa"
"""The system of units of :data:`MATERIALS`."""


@dataclass(frozen=True)
class Common:
    """A common material.

    Attributes:
        name: Name in lower case.
        young: Young's modulus (stress).
        poisson: Poisson's ratio.
        yield_stress: Uniaxial yield stress (stress). For concrete and clay, the parameter of von
            Mises' law that ``what`` describes.
        what: Description in words.
        source: Source of the numbers.
    """

    name: str
    young: float
    poisson: float
    yield_stress: float
    what: str
    source: str

    def in_system(self, system: Name) -> "Common":
        """Return the material, converted from the units of :data:`MATERIALS` to another system."""
        factor = SYSTEMS[TABLE].pascals / SYSTEMS[system].pascals
        return replace(self, young=self.young * factor, yield_stress=self.yield_stress * factor)


EN_1993 = "EN 1993-1-1:2005, 3.2.6 and table 3.1, up to 40 mm"
EN_1993_4 = "EN 1993-1-4:2006, 2.1.3 and table 2.1"
EN_1999 = "EN 1999-1-1:2007, 3.2.5 and table 3.2b"
EN_1993_8 = "EN 1993-1-8:2005, table 3.1"
EN_1992 = "EN 1992-1-1:2004, 3.1.3 and table 3.1"
CLAY = "EN ISO 14688-2:2018 (c_u); Duncan and Buchignani 1976 (E = 300 c_u)"


def _concrete(strength: float, cube: float, modulus: float) -> Common:
    """Return a concrete from its characteristic cylinder and cube strengths and E_cm (MPa).

    Von Mises' law gives the same strength in tension, which real concrete does not have.
    """
    name = f"c{strength:g}/{cube:g}"
    return Common(name, modulus, 0.2, strength, "concrete, for compression only", EN_1992)


def _clay(name: str, shear_strength: float) -> Common:
    """Return undrained clay of strength c_u (MPa), which is σ_y/√3 in plane strain (von Mises)."""
    what = f"clay, undrained, c_u {1e3 * shear_strength:g} kPa, in plane strain"
    return Common(name, 300 * shear_strength, 0.49, math.sqrt(3) * shear_strength, what, CLAY)


MATERIALS = (
    Common("s235", 210000.0, 0.3, 235.0, "structural steel", EN_1993),
    Common("s275", 210000.0, 0.3, 275.0, "structural steel", EN_1993),
    Common("s355", 210000.0, 0.3, 355.0, "structural steel", EN_1993),
    Common("s450", 210000.0, 0.3, 440.0, "structural steel", EN_1993),
    Common("1.4301", 200000.0, 0.3, 210.0, "stainless steel, hot rolled", EN_1993_4),
    Common("bolt-4.6", 210000.0, 0.3, 240.0, "bolts of class 4.6", EN_1993_8),
    Common("bolt-8.8", 210000.0, 0.3, 640.0, "bolts of class 8.8", EN_1993_8),
    Common("bolt-10.9", 210000.0, 0.3, 900.0, "bolts of class 10.9", EN_1993_8),
    Common("en-aw-6082-t6", 70000.0, 0.3, 260.0, "aluminium, extruded, 5 to 15 mm", EN_1999),
    Common("en-aw-6060-t66", 70000.0, 0.3, 160.0, "aluminium, extruded, up to 3 mm", EN_1999),
    _concrete(20.0, 25.0, 30000.0),
    _concrete(25.0, 30.0, 31000.0),
    _concrete(30.0, 37.0, 33000.0),
    _clay("clay-low", 0.02),
    _clay("clay-medium", 0.04),
    _clay("clay-high", 0.075),
)
"""Common materials in the units of :data:`TABLE`. A clay has the lowest strength of its class."""


def odd_numbers(young: float, yield_stress: float | None, system: Name | None) -> list[str]:
    """Return a question about each number or ratio that no real material has.

    Args:
        young: Young's modulus of a material (stress).
        yield_stress: Yield stress of the material (stress); None if it does not yield.
        system: System of units of both numbers; None if it is unknown.
    """
    told = []
    if system is not None:
        pascals, unit = young * SYSTEMS[system].pascals, SYSTEMS[system].stress
        # Young's modulus above that of every solid (Pa); diamond has 1.1e12.
        stiffest = 1e12
        # Young's modulus below that of every useful solid (Pa); a gel has about this value.
        softest = 1e3
        if not softest <= pascals <= stiffest:
            told.append(
                f"young = {young:g} {unit} is {pascals / 1e9:.3g} GPa, but steel has 210; is the "
                f"number in {unit}, as [units] says"
            )
    if yield_stress is not None:
        # Yield stress divided by Young's modulus: lead has 1e-4, rubber and polymers a few
        # hundredths.
        least, most = 1e-5, 0.1
        strain = yield_stress / young
        if not least <= strain <= most:
            told.append(
                f"yield_stress / young = {strain:.3g}, but materials have {least:g} to {most:g} "
                "(steel 0.001); are both numbers in the same unit"
            )
    return told


@dataclass(frozen=True)
class Soil:
    """A common drained soil with the Mohr–Coulomb condition.

    Attributes:
        name: Name in lower case.
        young: Young's modulus (stress).
        poisson: Poisson's ratio.
        cohesion: Effective cohesion (stress).
        friction_angle: Effective friction angle (degrees).
        unit_weight: Unit weight above the water table (stress/length).
        what: Description in words.
        source: Source of the numbers.
    """

    name: str
    young: float
    poisson: float
    cohesion: float
    friction_angle: float
    unit_weight: float
    what: str
    source: str

    def in_system(self, system: Name) -> "Soil":
        """Return the soil, converted from the units of :data:`SOILS` to another system."""
        one, other = SYSTEMS[TABLE], SYSTEMS[system]
        factor = one.pascals / other.pascals
        return replace(
            self,
            young=self.young * factor,
            cohesion=self.cohesion * factor,
            unit_weight=self.unit_weight * factor * other.metres / one.metres,
        )


NEN_9997 = "NEN 9997-1+C2:2017, table 2.b, low values, E at 100 kPa; Poisson's ratio assumed"


def _soil(
    name: str, young: float, cohesion: float, friction_angle: float, weight: float, what: str
) -> Soil:
    """Return a soil from E (MPa), c (kPa), φ (degrees) and γ (kN/m³)."""
    # The factors convert kPa to MPa and kN/m³ to N/mm³. Limit loads do not depend on Poisson's
    # ratio.
    return Soil(name, young, 0.3, 1e-3 * cohesion, friction_angle, 1e-6 * weight, what, NEN_9997)


SOILS = (
    _soil("loam-medium-drained", 3.0, 1.0, 27.5, 20.0, "loam, slightly sandy, medium"),
    _soil("loam-stiff-drained", 5.0, 2.5, 27.5, 21.0, "loam, slightly sandy, stiff"),
    _soil("clay-medium-drained", 2.0, 5.0, 17.5, 17.0, "clay, clean, medium"),
    _soil("clay-stiff-drained", 4.0, 13.0, 17.5, 19.0, "clay, clean, stiff"),
    _soil("sandy-clay-medium-drained", 3.0, 5.0, 22.5, 18.0, "clay, slightly sandy, medium"),
    _soil("sandy-clay-stiff-drained", 5.0, 13.0, 22.5, 20.0, "clay, slightly sandy, stiff"),
)
"""Common soils with cohesion, in the units of :data:`TABLE`."""


def find(name: str, system: Name = TABLE) -> Common:
    """Return the common material with a given name, for von Mises' law.

    Args:
        name: Name in lower or upper case.
        system: System of units of the result.

    Raises:
        InputError: If the table has no such material, or if the material is a soil.
    """
    names = {material.name: material for material in MATERIALS}
    if name.lower() in {soil.name for soil in SOILS}:
        raise InputError(
            f"'{name}' is ground for law = 'mohr-coulomb', but --material fills in law = "
            "'von-mises'; remove the option, and copy the numbers from `perfplast materials` into "
            "the case file."
        )
    if name.lower() not in names:
        raise InputError(f"there is no material '{name}' in the table; {nearest(name, names)}")
    return names[name.lower()].in_system(system)


def check_units(young: float, poisson: float, yield_stress: float, system: Name) -> None:
    """Refuse numbers that match a common material in another system of units.

    Args:
        young: Young's modulus of a material (stress).
        poisson: Poisson's ratio of the material.
        yield_stress: Yield stress of the material (stress).
        system: System of the units.

    Raises:
        InputError: If the numbers match; the message gives them converted to this system.
    """
    _check("yield_stress", (young, poisson, yield_stress), MATERIALS, system)


def check_soil_units(young: float, poisson: float, cohesion: float, system: Name) -> None:
    """Refuse numbers that match a common soil in another system of units.

    Args:
        young: Young's modulus of a soil (stress).
        poisson: Poisson's ratio of the soil.
        cohesion: Cohesion of the soil (stress).
        system: System of the units.

    Raises:
        InputError: If the numbers match; the message gives them converted to this system.
    """
    _check("cohesion", (young, poisson, cohesion), SOILS, system)


def _check(
    strength: str,
    given: tuple[float, float, float],
    table: Sequence[Common | Soil],
    system: Name,
) -> None:
    """Refuse numbers that match a table entry only in another system of units."""
    if _known(strength, given, table, system):
        return
    for other in SYSTEMS:
        one = _known(strength, given, table, other)
        if one is not None:
            meant = one.in_system(system)
            raise InputError(
                f"young = {given[0]:g} and {strength} = {given[2]:g} are the values for "
                f"'{one.name}' in {SYSTEMS[other].stress}, but [units] gives stresses in "
                f"{SYSTEMS[system].stress}; write young = {meant.young:g} and {strength} = "
                f"{getattr(meant, strength):g}."
            )


def _known(
    strength: str,
    given: tuple[float, float, float],
    table: Sequence[Common | Soil],
    system: Name,
) -> Common | Soil | None:
    """Return the table entry with the given numbers in a system of units; None if none matches."""
    # Allowed relative difference for numbers that are copied with six digits from a table.
    copied = 1e-5
    for one in table:
        here = one.in_system(system)
        listed = (here.young, here.poisson, getattr(here, strength))
        if all(math.isclose(a, b, rel_tol=copied) for a, b in zip(given, listed, strict=True)):
            return one
    return None
