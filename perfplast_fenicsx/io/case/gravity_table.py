"""Read ``[gravity]`` and ``[earthquake]``: weight, and a force perpendicular to the weight."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from perfplast_fenicsx.controls.control import Control
from perfplast_fenicsx.controls.seismic_control import SeismicControl
from perfplast_fenicsx.errors import InputError, nearest
from perfplast_fenicsx.io.case.schema import Table, at, convert
from perfplast_fenicsx.problem.declared.loads import BodyForce, Load


@dataclass(frozen=True)
class GravityTable:
    """The weight of bodies as a body force: density times acceleration.

    Numbers have the units of the case. With mm, N and MPa, steel has the density 7.85e-9 t/mm³, and
    the acceleration is 9810 mm/s². In SI units the numbers are 7850 kg/m³ and 9.81 m/s². To give
    unit weights (force per volume) as densities, use an acceleration of magnitude 1: steel 0.284
    lbf/in³, ground 120 lbf/ft³.

    Args:
        acceleration: Components of the acceleration vector (length per s²), such as
            [0.0, 0.0, -9810.0].
        density: Densities (mass per volume) by names of bodies; bodies without a density have no
            weight.
        constant: Whether the weight has its full value at any load factor; otherwise ζ multiplies
            the weight.
        name: Name of these loads for messages and stages.
    """

    acceleration: list[float]
    density: dict[str, float]
    constant: bool = True
    name: str = "gravity"

    def loads(self, bodies: Iterable[str]) -> list[BodyForce]:
        """Return one load for each body with a weight.

        Args:
            bodies: Names of all bodies.

        Raises:
            InputError: If the name of a body is unknown, or if a number is not valid for a weight.
        """
        known, found = list(bodies), []
        if not self.density:
            raise InputError("density is empty; give a density for each body that has a weight.")
        if not all(map(math.isfinite, self.acceleration)):
            raise InputError(
                f"acceleration = {self.acceleration} is not finite; give finite numbers."
            )
        for body, density in self.density.items():
            if body not in known:
                raise InputError(
                    f"density has an entry for '{body}', which is not a body; "
                    f"{nearest(body, known)}"
                )
            if not (density > 0 and math.isfinite(density)):
                raise InputError(f"the density of '{body}' is {density:g}; give a positive number.")
            force = tuple(density * g for g in self.acceleration)
            found.append(BodyForce(body, force, name=self.name, constant=self.constant))
        return found


@dataclass(frozen=True)
class EarthquakeTable:
    """The force of an earthquake: a coefficient times the weight, perpendicular to the weight.

    The earthquake does not change water pressures.

    Args:
        direction: Components of a vector in the direction of the force, perpendicular to the
            acceleration of [gravity]. Its magnitude does not matter. For example, [-1.0, 0.0]
            pushes to the left.
        coefficient: The force divided by the weight, k_h, which is the same at any load factor.
            Omit the coefficient with control = "seismic", which bounds the largest coefficient that
            the bodies carry.
    """

    direction: list[float]
    coefficient: float | None = None

    def loads(self, weights: Sequence[BodyForce], acceleration: Sequence[float]) -> list[Load]:
        """Return one load for each weight; without a coefficient, the load factor multiplies it.

        Args:
            weights: Loads from [gravity], and the weight of water.
            acceleration: Acceleration of [gravity].

        Raises:
            InputError: If the direction or the coefficient is not valid.
        """
        across, down = np.array(self.direction, dtype=np.float64), np.array(acceleration)
        if len(across) != len(down) or not np.isfinite(across).all() or not across.any():
            raise InputError(
                f"direction = {self.direction} is not valid; give {len(down)} numbers, as for the "
                "acceleration of [gravity], that are not all 0."
            )
        across /= np.linalg.norm(across)
        if abs(across @ down) > 1e-9 * np.linalg.norm(down):
            raise InputError(
                f"direction = {self.direction} is not perpendicular to the acceleration of "
                f"[gravity], {list(acceleration)}; correct one of them."
            )
        k = self.coefficient
        if k is not None and not (k > 0 and math.isfinite(k)):
            raise InputError(
                f"coefficient = {k:g} is not positive; give a positive coefficient, and reverse "
                "the direction if necessary."
            )
        found: list[Load] = []
        for weight in weights:
            size = float(np.linalg.norm(np.array(weight.value, dtype=np.float64)))
            force = tuple(float(x) for x in size * (1.0 if k is None else k) * across)
            constant = k is not None
            found.append(replace(weight, value=force, name="earthquake", constant=constant))
        return found


def earthquake_loads(
    table: Table | None,
    gravity: GravityTable | None,
    weights: Sequence[BodyForce],
    loads: Iterable[Load],
    loading: Control,
    place: str,
) -> list[Load]:
    """Return the loads from ``[earthquake]``; an empty list if this table is missing.

    Args:
        table: The table, as TOML has read it.
        gravity: The table ``[gravity]``; None if the case has no such table.
        weights: Loads from the weight of bodies and of water.
        loads: All other loads.
        loading: The control.
        place: Place of the table in the input, which messages name.

    Raises:
        InputError: If a key or value is not valid, if the coefficient is both given and sought or
            neither, or if another load would grow with the sought coefficient.
    """
    sought = isinstance(loading, SeismicControl)
    if table is None:
        if sought:
            raise InputError(
                f"{place} is missing, but control = 'seismic' computes its coefficient; give this "
                "table with the direction of the force."
            )
        return []
    found = convert(table, EarthquakeTable, place)
    with at(place):
        if gravity is None:
            raise InputError(
                "the earthquake force is a share of the weight, but [gravity] is missing; give "
                "[gravity]."
            )
        _check_coefficient(found.coefficient, sought, loads)
        return found.loads(weights, gravity.acceleration)


def _check_coefficient(k: float | None, sought: bool, loads: Iterable[Load]) -> None:
    """Raise an error if k is both given and sought or neither, or if another load grows."""
    if sought and k is not None:
        raise InputError(
            f"coefficient = {k:g} is given, but control = 'seismic' computes the coefficient; "
            "remove it, or give control = 'strength' for the factor of safety with this "
            "coefficient."
        )
    if not sought and k is None:
        raise InputError(
            "coefficient is missing; give it, or give control = 'seismic' under [loading] to "
            "bound the largest coefficient that the bodies can withstand."
        )
    for load in loads if sought else ():
        if not load.constant:
            raise InputError(
                f"the load '{load.name or load.on}' would grow with the coefficient that is "
                "sought; set constant = true for this load."
            )
