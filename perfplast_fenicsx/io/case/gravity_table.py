"""``[gravity]``: the weight of bodies, by their densities."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

from perfplast_fenicsx.errors import InputError, nearest
from perfplast_fenicsx.problem.declared.loads import BodyForce


@dataclass(frozen=True)
class GravityTable:
    """The weight of bodies: a force per volume, density times acceleration.

    Units are those of the case: with mm, N and MPa densities are in t/mm³ (steel: 7.85e-9) and the
    acceleration is 9810 mm/s²; in SI units 7850 kg/m³ and 9.81 m/s². Unit weights (force per
    volume) are densities with an acceleration of length 1: steel 0.284 lbf/in³, ground 120 lbf/ft³.

    Args:
        acceleration: A number a direction, such as [0.0, 0.0, -9810.0].
        density: Density of bodies by their names; those without one weigh nothing.
        constant: Whether the weight acts in full at any load factor; otherwise ζ multiplies it.
        name: Name in messages and stages.
    """

    acceleration: list[float]
    density: dict[str, float]
    constant: bool = True
    name: str = "gravity"

    def loads(self, bodies: Iterable[str]) -> list[BodyForce]:
        """Return a load for each body that weighs something.

        Args:
            bodies: Names of all bodies.

        Raises:
            InputError: If a name is unknown, or numbers are not valid for a weight.
        """
        known, found = list(bodies), []
        if not self.density:
            raise InputError("density is empty; give a number for each body that has a weight.")
        if not all(map(math.isfinite, self.acceleration)):
            raise InputError(f"acceleration = {self.acceleration} is not finite; correct it.")
        for body, density in self.density.items():
            if body not in known:
                raise InputError(f"density names '{body}', no body; {nearest(body, known)}")
            if not (density > 0 and math.isfinite(density)):
                raise InputError(f"the density of '{body}' is {density:g}; give a positive number.")
            force = tuple(density * g for g in self.acceleration)
            found.append(BodyForce(body, force, name=self.name, constant=self.constant))
        return found
