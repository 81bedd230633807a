"""``[units]`` of a case file, and whether the materials are in them."""

from collections.abc import Mapping

from perfplast_fenicsx.io.case.schema import Table, at, convert
from perfplast_fenicsx.materials.common import check_units
from perfplast_fenicsx.materials.laws import Material
from perfplast_fenicsx.units import Units

COPIED = ("young", "poisson", "yield_stress")
"""What ``perfplast materials`` shows of a material."""


def read_units(table: Table, materials: Mapping[str, Material], name: str) -> Units:
    """The units.

    Args:
        table: As TOML has it.
        materials: Of each body.
        name: Of the case file.

    Raises:
        InputError: If keys are wrong or contradict each other, or a material has the numbers that a
            common one has in another system.
    """
    units = convert(table, Units, f"{name}, [units]")
    if units.name is None:
        return units
    for body, material in materials.items():
        if all(hasattr(material, key) for key in COPIED):
            young, poisson, yield_stress = (getattr(material, key) for key in COPIED)
            with at(f"{name}, [material.{body}]"):
                check_units(young, poisson, yield_stress, units.name)
    return units
