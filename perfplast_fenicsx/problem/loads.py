"""Loads, named by physical surface or volume."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Traction:
    """Force per area on a surface.

    Args:
        on: Physical surface.
        value: The force per area (stress), one number a direction.
    """

    on: str
    value: Sequence[float]


@dataclass(frozen=True)
class Pressure:
    """Pressure on a surface.

    Args:
        on: Physical surface.
        value: The pressure (stress); a positive one pushes on the body.
    """

    on: str
    value: float


@dataclass(frozen=True)
class BodyForce:
    """Force per volume.

    Args:
        on: Physical volume.
        value: The force per volume, one number a direction.
    """

    on: str
    value: Sequence[float]


Load = Traction | Pressure | BodyForce

LOADS: dict[str, type[Any]] = {"traction": Traction, "pressure": Pressure, "body_force": BodyForce}
"""Kinds of loads by their name in case files."""
