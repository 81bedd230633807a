"""Loads, named by physical surface or volume.

What a load is given by may be a formula in the coordinates, such as ``"10*maximum(8 - y, 0)"``
(:mod:`perfplast_fenicsx.formulas`). It is taken at the nodes of quadratic cells, so that one of
degree 2 is exact.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.errors import InputError

Formula = float | str
"""A number, or a formula in x, y, z."""


@dataclass(frozen=True)
class Traction:
    """Force per area on a surface.

    Args:
        on: Physical surface.
        value: The force per area (stress), a number or formula a direction.
        name: What messages call it.
        constant: Whether it acts in full at any load factor; otherwise ζ multiplies it.
    """

    on: str
    value: Sequence[Formula]
    name: str = ""
    constant: bool = False


@dataclass(frozen=True)
class Pressure:
    """Pressure on a surface.

    Args:
        on: Physical surface.
        value: The pressure (stress), a number or formula; a positive one pushes on the body.
        name: What messages call it.
        constant: Whether it acts in full at any load factor; otherwise ζ multiplies it.
    """

    on: str
    value: Formula
    name: str = ""
    constant: bool = False


@dataclass(frozen=True)
class BodyForce:
    """Force per volume.

    Args:
        on: Physical volume.
        value: The force per volume, a number or formula a direction.
        name: What messages call it.
        constant: Whether it acts in full at any load factor; otherwise ζ multiplies it.
    """

    on: str
    value: Sequence[Formula]
    name: str = ""
    constant: bool = False


@dataclass(frozen=True)
class PorePressure:
    """Pressure p of water in the pores of a volume, whose law is one of effective stresses.

    The total stress is σ − p δ (tension is positive), so that p does the work ∫ p div v.

    Args:
        on: Physical volume.
        value: The pressure (stress), a number or formula.
        name: What messages call it.
        constant: Whether it acts in full at any load factor; otherwise ζ multiplies it.
    """

    on: str
    value: Formula
    name: str = ""
    constant: bool = True


@dataclass(frozen=True)
class Force:
    """Force and moment on a rigid surface that is free to move.

    Args:
        on: The rigid surface.
        value: The force, one number a direction; in the plane for each unit of depth.
        moment: About the point: a number in the plane, one for each axis in space; 0 without.
        point: Where the force acts (length; 2 or 3 numbers).
        name: What messages call it.
        constant: Whether it acts in full at any load factor; otherwise ζ multiplies it.
    """

    on: str
    value: Sequence[float]
    moment: float | Sequence[float] = ()
    point: Sequence[float] = ()
    name: str = ""
    constant: bool = False


Load = Traction | Pressure | BodyForce | PorePressure | Force

LOADS: dict[str, type[Any]] = {
    "traction": Traction,
    "pressure": Pressure,
    "body_force": BodyForce,
    "pore_pressure": PorePressure,
    "force": Force,
}
"""Kinds of loads by their name in case files."""


def is_uniform(load: Load) -> bool:
    """Whether a load is a traction, a pressure or a body force, and no other, given as numbers."""
    known = type(load) in (Traction, Pressure, BodyForce)
    return known and np.asarray(load.value).dtype.kind in "fiu"


def uniform(load: Load) -> Floats:
    """What a load gives, as numbers: one of a pressure, else one a direction.

    Raises:
        InputError: If it is a formula, or of a kind that strict bounds do not know, such as the
            pressure in pores.
    """
    values = np.atleast_1d(np.asarray(load.value))
    if type(load) not in LOADS.values():
        raise InputError(
            f"the load on '{load.on}' is a {type(load).__name__}, which strict bounds do not know;"
            " give a Traction, a Pressure or a BodyForce, or seek the limit load of the mesh alone."
        )
    if not is_uniform(load):
        raise InputError(
            f"the load on '{load.on}' is a formula, a pore pressure or a force, and strict bounds"
            " are for uniform loads; give it as numbers, or seek the limit load of the mesh alone."
        )
    return values.astype(np.float64)
