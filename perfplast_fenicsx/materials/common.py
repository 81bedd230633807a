"""Common materials to start from, in N and mm (MPa). A design goes by its standard itself."""

from dataclasses import dataclass

from perfplast_fenicsx.errors import InputError, nearest


@dataclass(frozen=True)
class Common:
    """A common material.

    Attributes:
        name: As in its standard, in lower case.
        young: Young's modulus (MPa).
        poisson: Poisson's ratio.
        yield_stress: In uniaxial tension (MPa); for what is no metal, that of von Mises' law with
            the same shear strength.
        what: In words.
        source: Where the numbers are from.
    """

    name: str
    young: float
    poisson: float
    yield_stress: float
    what: str
    source: str


EN_1993 = "EN 1993-1-1:2005, 3.2.6 and table 3.1, up to 40 mm"
EN_1999 = "EN 1999-1-1:2007, 3.2.5 and table 3.2b"
EN_1993_8 = "EN 1993-1-8:2005, table 3.1"

MATERIALS = (
    Common("s235", 210000.0, 0.3, 235.0, "structural steel", EN_1993),
    Common("s275", 210000.0, 0.3, 275.0, "structural steel", EN_1993),
    Common("s355", 210000.0, 0.3, 355.0, "structural steel", EN_1993),
    Common("s450", 210000.0, 0.3, 440.0, "structural steel", EN_1993),
    Common("bolt-4.6", 210000.0, 0.3, 240.0, "bolts of class 4.6", EN_1993_8),
    Common("bolt-8.8", 210000.0, 0.3, 640.0, "bolts of class 8.8", EN_1993_8),
    Common("bolt-10.9", 210000.0, 0.3, 900.0, "bolts of class 10.9", EN_1993_8),
    Common("en-aw-6082-t6", 70000.0, 0.3, 260.0, "aluminium, extruded, 5 to 15 mm", EN_1999),
    Common("en-aw-6060-t66", 70000.0, 0.3, 160.0, "aluminium, extruded, up to 3 mm", EN_1999),
)


def find(name: str) -> Common:
    """The material of a name.

    Raises:
        InputError: If there is none.
    """
    names = {material.name: material for material in MATERIALS}
    if name.lower() not in names:
        raise InputError(f"there is no material '{name}' in the table; {nearest(name, names)}")
    return names[name.lower()]
