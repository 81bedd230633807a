"""List common materials as starting values, in any system of units.

For a design, take the numbers from its standard.
"""

import math
from dataclasses import dataclass, replace

from perfplast_fenicsx.units import SYSTEMS, Name

TABLE: Name = "mm-N-MPa"
"""The units of :data:`MATERIALS`."""


@dataclass(frozen=True)
class Common:
    """A common material.

    Attributes:
        name: Name as in its standard, in lower case.
        young: Young's modulus (stress).
        poisson: Poisson's ratio.
        yield_stress: Uniaxial yield stress (stress); for a material that is not a metal, the
            parameter of von Mises' law that ``what`` describes.
        what: Description in words.
        source: Source of its numbers.
    """

    name: str
    young: float
    poisson: float
    yield_stress: float
    what: str
    source: str

    def in_system(self, system: Name) -> "Common":
        """Return the material in another system of units than that of :data:`MATERIALS`."""
        factor = SYSTEMS[TABLE].pascals / SYSTEMS[system].pascals
        return replace(self, young=self.young * factor, yield_stress=self.yield_stress * factor)


EN_1993 = "EN 1993-1-1:2005, 3.2.6 and table 3.1, up to 40 mm"
EN_1993_4 = "EN 1993-1-4:2006, 2.1.3 and table 2.1"
EN_1999 = "EN 1999-1-1:2007, 3.2.5 and table 3.2b"
EN_1993_8 = "EN 1993-1-8:2005, table 3.1"
EN_1992 = "EN 1992-1-1:2004, 3.1.3 and table 3.1"
CLAY = "EN ISO 14688-2:2018 (c_u); Duncan and Buchignani 1976 (E = 300 c_u)"


def _concrete(strength: float, cube: float, modulus: float) -> Common:
    """Return concrete by its characteristic strength of cylinders and cubes, and E_cm (MPa).

    Von Mises' law assigns it the same strength in tension, which real concrete does not have.
    """
    name = f"c{strength:g}/{cube:g}"
    return Common(name, modulus, 0.2, strength, "concrete, for compression only", EN_1992)


def _clay(name: str, shear_strength: float) -> Common:
    """Return undrained clay by c_u (MPa); in plane strain von Mises' law yields at σ_y/√3."""
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
"""Common materials in the units :data:`TABLE`. A clay has the least strength of its class."""


def odd_numbers(young: float, yield_stress: float | None, system: Name | None) -> list[str]:
    """Return a sentence for each number that no real material has.

    Args:
        young: Young's modulus of a material (stress).
        yield_stress: Its yield stress (stress), if it yields.
        system: System of their units, if known.
    """
    told = []
    if system is not None:
        pascals, unit = young * SYSTEMS[system].pascals, SYSTEMS[system].stress
        # Young's modulus above that of any solid (Pa); diamond has 1.1e12.
        stiffest = 1e12
        # Young's modulus below that of any useful solid (Pa); a gel has about this value.
        softest = 1e3
        if not softest <= pascals <= stiffest:
            told.append(
                f"young = {young:g} {unit} is {pascals / 1e9:.3g} GPa, but steel has 210; "
                f"is it in {unit}, as [units] says"
            )
    if yield_stress is not None:
        # Yield stress over Young's modulus: lead has 1e-4, rubber and polymers a few hundredths.
        least, most = 1e-5, 0.1
        strain = yield_stress / young
        if not least <= strain <= most:
            told.append(
                f"yield_stress / young = {strain:.3g}, but materials have {least:g} to "
                f"{most:g} (steel 0.001); are both in the same unit"
            )
    return told
