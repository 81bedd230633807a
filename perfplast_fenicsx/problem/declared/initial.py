"""Declare initial strains: temperatures, initial stress, bolts."""

from collections.abc import Sequence
from dataclasses import dataclass

from perfplast_fenicsx.problem.declared.bolt import Bolt
from perfplast_fenicsx.problem.declared.loads import Formula


@dataclass(frozen=True)
class Temperature:
    """Change of temperature in a volume, constant at any load factor unless stages name it.

    Args:
        on: Physical volume; its material has an ``expansion``.
        change: The change (temperature), a number or a formula in x, y, z.
        name: Name in stages; by default ``on``.
    """

    on: str
    change: Formula
    name: str = ""


@dataclass(frozen=True)
class InitialStress:
    """Stress in a volume before any deformation, constant at any load factor.

    Args:
        on: Physical volume.
        stress: Its components xx, yy, zz, yz, xz, xy, in the plane xx, yy, zz, xy (stress; tension
            is positive), numbers or formulas in x, y, z.
    """

    on: str
    stress: Sequence[Formula]


Initial = Temperature | InitialStress | Bolt
