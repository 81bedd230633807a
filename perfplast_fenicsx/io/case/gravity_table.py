"""Read ``[gravity]`` and ``[earthquake]``: the weight of bodies, and a transverse share of it."""

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

    Units are those of the case: with mm, N and MPa densities are in t/mm³ (steel: 7.85e-9) and the
    acceleration is 9810 mm/s²; in SI units 7850 kg/m³ and 9.81 m/s². Unit weights (force per
    volume) are densities with an acceleration of length 1: steel 0.284 lbf/in³, ground 120 lbf/ft³.

    Args:
        acceleration: A number for each direction, such as [0.0, 0.0, -9810.0].
        density: Density of bodies by their names; bodies without a density have no weight.
        constant: Whether the weight acts in full at any load factor; otherwise ζ multiplies it.
        name: Name in messages and stages.
    """

    acceleration: list[float]
    density: dict[str, float]
    constant: bool = True
    name: str = "gravity"

    def loads(self, bodies: Iterable[str]) -> list[BodyForce]:
        """Return a load for each body with a weight.

        Args:
            bodies: Names of all bodies.

        Raises:
            InputError: If a name is unknown, or if numbers are not valid for a weight.
        """
        known, found = list(bodies), []
        if not self.density:
            raise InputError("density is empty; give a number for each body that has a weight.")
        if not all(map(math.isfinite, self.acceleration)):
            raise InputError(f"acceleration = {self.acceleration} is not finite; correct it.")
        for body, density in self.density.items():
            if body not in known:
                raise InputError(
                    f"density names '{body}', which is not a body; {nearest(body, known)}"
                )
            if not (density > 0 and math.isfinite(density)):
                raise InputError(f"the density of '{body}' is {density:g}; give a positive number.")
            force = tuple(density * g for g in self.acceleration)
            found.append(BodyForce(body, force, name=self.name, constant=self.constant))
        return found


@dataclass(frozen=True)
class EarthquakeTable:
    """The force of an earthquake: a coefficient times the weight, perpendicular to it.

    Water in the pores and on the surface remains hydrostatic.

    Args:
        direction: Direction of the force, a number for each direction, perpendicular to the
            acceleration of [gravity]; its length does not matter. [-1.0, 0.0] pushes to the left.
        coefficient: The force divided by the weight, k_h, at any load factor. Omit it with control
            = "seismic", which bounds the largest coefficient that is carried.
    """

    direction: list[float]
    coefficient: float | None = None

    def loads(self, weights: Sequence[BodyForce], acceleration: Sequence[float]) -> list[Load]:
        """Return a load for each weight; without a coefficient, the load factor multiplies it.

        Args:
            weights: Loads of [gravity], and the weight of water.
            acceleration: Acceleration of [gravity].

        Raises:
            InputError: If the direction or the coefficient is not valid, or if there is no weight.
        """
        across, down = np.array(self.direction, dtype=np.float64), np.array(acceleration)
        if len(across) != len(down) or not np.isfinite(across).all() or not across.any():
            raise InputError(
                f"direction = {self.direction} is not valid; give {len(down)} numbers that "
                "are not all 0, as many as the acceleration of [gravity] has."
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
                f"coefficient = {k:g} is not positive; reverse the direction, or remove "
                "[earthquake]."
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
    """Return the loads of ``[earthquake]``; an empty list without it.

    Args:
        table: The table, as TOML has read it.
        gravity: ``[gravity]``, if there is one.
        weights: Loads of the weight, including that of water.
        loads: All other loads.
        loading: The control.
        place: Place of the table in the input, which messages name.

    Raises:
        InputError: If keys or values are wrong, if the coefficient is neither given nor sought, or
            both, or if something else grows with the sought one.
    """
    sought = isinstance(loading, SeismicControl)
    if table is None:
        if sought:
            raise InputError(
                f"{place} is missing, but control = 'seismic' seeks its coefficient; give "
                "the table with the direction of the force."
            )
        return []
    found = convert(table, EarthquakeTable, place)
    with at(place):
        if gravity is None:
            raise InputError(
                "there is no [gravity], but the force is a share of the weight; give [gravity]."
            )
        _check_coefficient(found.coefficient, sought, loads)
        return found.loads(weights, gravity.acceleration)


def _check_coefficient(k: float | None, sought: bool, loads: Iterable[Load]) -> None:
    """Refuse a coefficient that is neither given nor sought, or both, and other growing loads."""
    if sought and k is not None:
        raise InputError(
            f"coefficient = {k:g} is given, but control = 'seismic' seeks it; remove it, "
            "or give control = 'strength' for the factor of safety with it."
        )
    if not sought and k is None:
        raise InputError(
            "coefficient is missing; give it, or control = 'seismic' under [loading], which seeks"
            " the largest one that is carried."
        )
    for load in loads if sought else ():
        if not load.constant:
            raise InputError(
                f"the load '{load.name or load.on}' would grow with the coefficient that is sought;"
                " give it constant = true."
            )
