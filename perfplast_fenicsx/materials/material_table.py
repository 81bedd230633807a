"""Look up common materials: one by its name, or numbers copied in the wrong units."""

import math
from collections.abc import Sequence

from perfplast_fenicsx.errors import InputError, nearest
from perfplast_fenicsx.materials.common import MATERIALS, TABLE, Common
from perfplast_fenicsx.materials.soil import SOILS, Soil
from perfplast_fenicsx.units import SYSTEMS, Name


def find(name: str, system: Name = TABLE) -> Common:
    """Return the common material with a given name, for von Mises' law.

    Args:
        name: Name in lower or upper case.
        system: The units of its numbers.

    Raises:
        InputError: If there is no such material, or if it is a soil.
    """
    names = {material.name: material for material in MATERIALS}
    if name.lower() in {soil.name for soil in SOILS}:
        raise InputError(
            f"'{name}' is ground for law = 'mohr-coulomb', but --material fills in "
            "'von-mises'; remove the option, and copy the numbers of `perfplast "
            "materials` into the case file."
        )
    if name.lower() not in names:
        raise InputError(f"there is no material '{name}' in the table; {nearest(name, names)}")
    return names[name.lower()].in_system(system)


def check_units(young: float, poisson: float, yield_stress: float, system: Name) -> None:
    """Refuse numbers that match a common material in another system of units.

    Args:
        young: Young's modulus of a material (stress).
        poisson: Its Poisson's ratio.
        yield_stress: Its yield stress (stress).
        system: System of the units.

    Raises:
        InputError: With the numbers in this system.
    """
    _check("yield_stress", (young, poisson, yield_stress), MATERIALS, system)


def check_soil_units(young: float, poisson: float, cohesion: float, system: Name) -> None:
    """Refuse numbers that match a common soil in another system of units.

    Args:
        young: Young's modulus of a soil (stress).
        poisson: Its Poisson's ratio.
        cohesion: Its cohesion (stress).
        system: System of the units.

    Raises:
        InputError: With the numbers in this system.
    """
    _check("cohesion", (young, poisson, cohesion), SOILS, system)


def _check(
    strength: str,
    given: tuple[float, float, float],
    table: Sequence[Common | Soil],
    system: Name,
) -> None:
    """Refuse Young's modulus, Poisson's ratio and strength that match in another system."""
    if _known(strength, given, table, system):
        return
    for other in SYSTEMS:
        one = _known(strength, given, table, other)
        if one is not None:
            meant = one.in_system(system)
            raise InputError(
                f"young = {given[0]:g} and {strength} = {given[2]:g} are those of "
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
    """Return the entry of a table that has these numbers in a system."""
    # Allowed relative difference of numbers copied from a table with six digits.
    copied = 1e-5
    for one in table:
        here = one.in_system(system)
        listed = (here.young, here.poisson, getattr(here, strength))
        if all(math.isclose(a, b, rel_tol=copied) for a, b in zip(given, listed, strict=True)):
            return one
    return None
