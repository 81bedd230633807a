"""Common materials to start from, in any system of units.

Take the numbers of a design from its standard.
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
        name: As in its standard, in lower case.
        young: Young's modulus (stress).
        poisson: Poisson's ratio.
        yield_stress: In uniaxial tension (stress); for what is no metal, that of von Mises' law
            which ``what`` says.
        what: In words.
        source: Source of the numbers.
    """

    name: str
    young: float
    poisson: float
    yield_stress: float
    what: str
    source: str

    def in_system(self, system: Name) -> "Common":
        """Return the same in another system of units, from that of :data:`MATERIALS`."""
        factor = SYSTEMS[TABLE].pascals / SYSTEMS[system].pascals
        return replace(self, young=self.young * factor, yield_stress=self.yield_stress * factor)


EN_1993 = "EN 1993-1-1:2005, 3.2.6 and table 3.1, up to 40 mm"
EN_1993_4 = "EN 1993-1-4:2006, 2.1.3 and table 2.1"
EN_1999 = "EN 1999-1-1:2007, 3.2.5 and table 3.2b"
EN_1993_8 = "EN 1993-1-8:2005, table 3.1"
EN_1992 = "EN 1992-1-1:2004, 3.1.3 and table 3.1"
CLAY = "EN ISO 14688-2:2018 (c_u); Duncan and Buchignani 1976 (E = 300 c_u)"


def _concrete(strength: float, cube: float, modulus: float) -> Common:
    """Concrete by its characteristic strength of cylinders and cubes, and E_cm (MPa).

    Von Mises' law gives it the same strength in tension, which it has not.
    """
    name = f"c{strength:g}/{cube:g}"
    return Common(name, modulus, 0.2, strength, "concrete, for pressure alone", EN_1992)


def _clay(name: str, shear_strength: float) -> Common:
    """Clay that cannot drain, by c_u (MPa): in plane strain von Mises' law yields at σ_y/√3."""
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
"""In :data:`TABLE`. Of each class of clays the least strength."""


def odd_numbers(young: float, yield_stress: float | None, system: Name | None) -> list[str]:
    """Return a sentence for each number that no real material has.

    Args:
        young: Young's modulus of a material (stress).
        yield_stress: Yield stress of it (stress), if it yields.
        system: System of their units, if known.
    """
    told = []
    if system is not None:
        pascals, unit = young * SYSTEMS[system].pascals, SYSTEMS[system].stress
        # Young's modulus beyond which there is no solid (Pa); diamond has 1.1e12.
        stiffest = 1e12
        # Young's modulus below which there is none that is of use (Pa); a gel has about so much.
        softest = 1e3
        if not softest <= pascals <= stiffest:
            told.append(
                f"young = {young:g} {unit} is {pascals / 1e9:.3g} GPa, and steel has 210; is it in"
                f" {unit}, as [units] says"
            )
    if yield_stress is not None:
        # Yield stress over Young's modulus: lead has 1e-4, rubber and polymers a few hundredths.
        least, most = 1e-5, 0.1
        strain = yield_stress / young
        if not least <= strain <= most:
            told.append(
                f"yield_stress / young = {strain:.3g}, and materials have {least:g} to {most:g}"
                " (steel 0.001); are both in the same unit"
            )
    return told
