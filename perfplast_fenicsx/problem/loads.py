"""Loads, named by physical surface or volume: each is a class that says all of itself.

A load has the class attributes of :class:`Load`, and one that is spread over its surface or volume
the term in the work L(v) as well (:class:`SpreadLoad`). Case files, units, words and reports read
these, so that a new one is its class and an entry of :data:`LOADS`.

What a load is given by may be a formula in the coordinates, such as ``"10*maximum(8 - y, 0)"``
(:mod:`perfplast_fenicsx.formulas`). It is taken at the nodes of quadratic cells, so that one of
degree 2 is exact.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from perfplast_fenicsx.errors import InputError

if TYPE_CHECKING:  # what reads results for pictures and reports starts no DOLFINx
    from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh

Formula = float | str
"""A number, or a formula in x, y, z."""

Quantities = Mapping[str, str]


class Load:
    """What each load says.

    Attributes:
        words: What reports call it.
        quantities: Units of what it is given by, by the keys of :meth:`units.Units.table`: those of
            ``value``, which case files call as the load's kind, and of other fields that are a load
            by themselves.
        in_volume: Whether ``on`` is a volume, and no surface.
        on: Physical surface or volume.
        value: A number or formula, or one a direction.
        name: What messages and stages call it.
        constant: Whether it acts in full at any load factor; otherwise ζ multiplies it.
    """

    words: ClassVar[str]
    quantities: ClassVar[Quantities]
    in_volume: ClassVar[bool] = False

    on: str
    value: Formula | Sequence[Formula]
    name: str
    constant: bool


class SpreadLoad(Load):
    """A load with a density in its volume or on its surface.

    Attributes:
        scalar: Whether ``value`` is one number or formula, and not one a direction.
    """

    scalar: ClassVar[bool] = False

    def work(self, value: Any, v: Any, tagged_mesh: "TaggedMesh") -> Any:
        """Its work for each volume or area, what L(v) is the integral of.

        Args:
            value: Of the load in UFL, a scalar or a vector.
            v: Displacement, a vector in UFL.
            tagged_mesh: What it acts on.
        """
        raise NotImplementedError


@dataclass(frozen=True)
class Traction(SpreadLoad):
    """Force per area on a surface.

    Args:
        on: Physical surface.
        value: The force per area (stress), a number or formula a direction.
        name: What messages call it.
        constant: Whether it acts in full at any load factor; otherwise ζ multiplies it.
        total: Whether a traction is the whole force on its surface, which is spread evenly over the
            area in the mesh.
    """

    words: ClassVar[str] = "traction"
    quantities: ClassVar[Quantities] = MappingProxyType({"value": "stress"})

    on: str
    value: Sequence[Formula]
    name: str = ""
    constant: bool = False
    total: bool = False

    def work(self, value: Any, v: Any, tagged_mesh: "TaggedMesh") -> Any:
        """t·v."""
        import ufl

        return ufl.inner(value, v)


@dataclass(frozen=True)
class Pressure(SpreadLoad):
    """Pressure on a surface.

    Args:
        on: Physical surface.
        value: The pressure (stress), a number or formula; a positive one pushes on the body.
        name: What messages call it.
        constant: Whether it acts in full at any load factor; otherwise ζ multiplies it.
    """

    words: ClassVar[str] = "pressure"
    quantities: ClassVar[Quantities] = MappingProxyType({"value": "stress"})
    scalar: ClassVar[bool] = True

    on: str
    value: Formula
    name: str = ""
    constant: bool = False

    def work(self, value: Any, v: Any, tagged_mesh: "TaggedMesh") -> Any:
        """−p n·v."""
        import ufl

        return ufl.inner(-value * ufl.FacetNormal(tagged_mesh.mesh), v)


@dataclass(frozen=True)
class BodyForce(SpreadLoad):
    """Force per volume.

    Args:
        on: Physical volume.
        value: The force per volume, a number or formula a direction.
        name: What messages call it.
        constant: Whether it acts in full at any load factor; otherwise ζ multiplies it.
    """

    words: ClassVar[str] = "force per volume"
    quantities: ClassVar[Quantities] = MappingProxyType({"value": "force_density"})
    in_volume: ClassVar[bool] = True

    on: str
    value: Sequence[Formula]
    name: str = ""
    constant: bool = False

    def work(self, value: Any, v: Any, tagged_mesh: "TaggedMesh") -> Any:
        """f·v."""
        import ufl

        return ufl.inner(value, v)


@dataclass(frozen=True)
class PorePressure(SpreadLoad):
    """Pressure p of water in the pores of a volume, whose law is one of effective stresses.

    The total stress is σ − p δ (tension is positive), so that p does the work ∫ p div v.

    Args:
        on: Physical volume.
        value: The pressure (stress), a number or formula.
        name: What messages call it.
        constant: Whether it acts in full at any load factor; otherwise ζ multiplies it.
    """

    words: ClassVar[str] = "water pressure in the pores"
    quantities: ClassVar[Quantities] = MappingProxyType({"value": "stress"})
    in_volume: ClassVar[bool] = True
    scalar: ClassVar[bool] = True

    on: str
    value: Formula
    name: str = ""
    constant: bool = True

    def work(self, value: Any, v: Any, tagged_mesh: "TaggedMesh") -> Any:
        """P div v."""
        from perfplast_fenicsx.mesh.kinematics import divergence

        return value * divergence(tagged_mesh.kinematics, v)


@dataclass(frozen=True)
class Force(Load):
    """Force and moment on a rigid surface that is free to move.

    Args:
        on: The rigid surface.
        value: On a rigid surface that is free to move, one number a direction; in the plane for
            each unit of depth.
        moment: With or in place of a force, a number in the plane, one for each axis in space.
        point: Where the force acts, and what the moment is about (length); the origin without.
        name: What messages call it.
        constant: Whether it acts in full at any load factor; otherwise ζ multiplies it.
    """

    words: ClassVar[str] = "force"
    quantities: ClassVar[Quantities] = MappingProxyType({"value": "force", "moment": "moment"})

    on: str
    value: Sequence[float] = ()
    moment: float | Sequence[float] = ()
    point: Sequence[float] = ()
    name: str = ""
    constant: bool = False


BOUNDED = (
    "strict bounds are for tractions and pressures that are linear on each facet, and forces per"
    " volume that are numbers; give one of these, or seek the limit load of the mesh alone"
    " (control = 'work', until = 'limit')."
)
"""What a refusal says of the loads that strict bounds know."""

LOADS: dict[str, type[Any]] = {
    "traction": Traction,
    "pressure": Pressure,
    "body_force": BodyForce,
    "pore_pressure": PorePressure,
    "force": Force,
}
"""Kinds of loads by their name in case files."""

ON_SURFACES = (Traction, Pressure)
"""Loads whose tractions strict bounds and proofs know, where they are linear on facets."""


def kind_of(load: Load) -> str:
    """How case files call a load's kind; the name of its class where it is in no case file."""
    known = (kind for kind, cls in LOADS.items() if cls is type(load))
    return next(known, type(load).__name__)


def is_uniform(load: Load) -> bool:
    """Whether a load is given as numbers."""
    return np.asarray(load.value).dtype.kind in "fiu"


def is_bounded(load: Load) -> bool:
    """Whether strict bounds know a load: a traction, a pressure or a uniform force per volume."""
    return type(load) in ON_SURFACES or (type(load) is BodyForce and is_uniform(load))


def check_bounded(load: Load) -> None:
    """Refuse a load that strict bounds and proofs do not know.

    Raises:
        InputError: If it is of another kind, or a force per volume that is a formula.
    """
    if not is_bounded(load):
        kind = kind_of(load).replace("_", " ")
        what = "force per volume that is a formula" if type(load) is BodyForce else kind
        raise InputError(f"the load on '{load.on}' is a {what}, and {BOUNDED}")
