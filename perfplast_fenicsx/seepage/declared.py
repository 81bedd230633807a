"""Declare the flow of water through ground."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

from perfplast_fenicsx.errors import InputError


@dataclass(frozen=True)
class Head:
    """A known water level at a surface of the ground.

    Args:
        on: Physical name of the surface. Its part above the level is a seepage face.
        level: Height of the water level, in the upward coordinate (length).
        presses: Whether the water presses on the surface, as the water of a reservoir does. Give
            false if the ground continues beyond the surface.
        drawdown: Level (length) to which the water outside has fallen so quickly that no water has
            left the ground. The pore pressure is the pressure of the steady flow, minus the loss of
            outside water pressure vertically above the point (A. W. Bishop, 1954, with B = 1).
        name: Name in messages and tables; by default the name of the surface.
    """

    on: str
    level: float
    presses: bool = True
    drawdown: float | None = None
    name: str = ""

    def __post_init__(self) -> None:
        if not math.isfinite(self.level):
            raise InputError(f"level = {self.level} is not finite; give the height of the water.")
        if self.drawdown is not None and not -math.inf < self.drawdown < self.level:
            raise InputError(
                f"drawdown = {self.drawdown} is not below level = {self.level}; give the level to"
                " which the water outside has fallen, or remove drawdown."
            )
        if self.drawdown is not None and not self.presses:
            raise InputError(
                "drawdown applies only to water that presses on the ground; remove drawdown, or "
                "presses = false."
            )

    @property
    def outside(self) -> float:
        """Return the level of the water that presses on the surface (length)."""
        return self.level if self.drawdown is None else self.drawdown


@dataclass(frozen=True)
class Seepage:
    """Steady flow of water through ground, by Darcy's law, with a free surface.

    The pore pressure of this flow is a constant load of the case. Boundaries that are not named are
    impervious, and so are bodies without a conductivity. Water flows between bodies where their
    vertices coincide.

    Args:
        conductivity: Hydraulic conductivity of each body through which water flows (length per
            time): a number, or one for each direction, such as ``{sand = 1e-4, clay = [1e-6,
            1e-7]}``.
        head: Surfaces at which the water level is known.
        outlet: Seepage faces and drains: surfaces through which water can flow out of the ground
            into the air.
        up: The coordinate that points upwards.
        unit_weight: Unit weight of water (force per volume). If it is missing, the case uses 9.81
            kN/m³ in the units of ``[units]``.
    """

    conductivity: dict[str, float | list[float]]
    head: list[Head]
    outlet: list[str] = field(default_factory=list)
    up: Literal["x", "y", "z"] = "y"
    unit_weight: float | None = None

    def __post_init__(self) -> None:
        weight = self.unit_weight
        if weight is not None and not (weight > 0 and math.isfinite(weight)):
            raise InputError(
                f"unit_weight = {weight} is not a positive number; give the unit weight of water,"
                " such as 9.81 with kN and m."
            )
        if not self.conductivity:
            raise InputError(
                "conductivity is empty; give a number for each body through which water flows."
            )
        if not self.head:
            raise InputError(
                "no [[seepage.head]] is given; give the surfaces at which the water level is known."
            )

    @property
    def axis(self) -> int:
        """Return the index of the coordinate that points upwards."""
        return "xyz".index(self.up)

    def conductivities(self, body: str, dim: int) -> Sequence[float]:
        """Return the conductivity of a body in each direction.

        Args:
            body: Name of the body.
            dim: Number of directions.

        Raises:
            InputError: If there are too few or too many numbers, or if one is not positive.
        """
        given = self.conductivity[body]
        each = [given] * dim if isinstance(given, int | float) else list(given)
        if len(each) != dim or not all(one > 0 and math.isfinite(one) for one in each):
            raise InputError(
                f"the conductivity of '{body}' is {given}; give a positive number, or one for each"
                f" of the {dim} directions."
            )
        return each
