"""Loads, named by physical surface or volume: each is a class that says all of itself.

A load has the class attributes of :class:`Load`, and one that is spread over its surface or volume
the term in the work L(v) as well (:class:`SpreadLoad`). Case files, units, words and reports read
these, so that a new one is its class and an entry of :data:`LOADS`.

What a load is given by may be a formula in the coordinates, such as ``"10*maximum(8 - y, 0)"``
(:mod:`perfplast_fenicsx.formulas`). It is taken at the nodes of quadratic cells, so that one of
degree 2 is exact.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.enclosures import enclosed
from perfplast_fenicsx.errors import InputError, place_of
from perfplast_fenicsx.problem.declared.load import Formula as Formula
from perfplast_fenicsx.problem.declared.load import Load as Load
from perfplast_fenicsx.problem.declared.load import Quantities
from perfplast_fenicsx.problem.declared.load import SpreadLoad as SpreadLoad

if TYPE_CHECKING:  # what reads results for pictures and reports starts no DOLFINx
    from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh


@dataclass(frozen=True)
class Traction(SpreadLoad):
    """Force per area on a surface.

    Args:
        on: Physical surface.
        value: The force per area (stress), a number or formula a direction.
        name: Name in messages.
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
        name: Name in messages.
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
        name: Name in messages.
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
class ForceBelow(BodyForce):
    """Force per volume in the cells of a volume that are below a line, such as a water table.

    Args:
        on: Physical volume.
        value: The force per volume, a number a direction.
        name: Name in messages.
        constant: Whether it acts in full at any load factor; otherwise ζ multiplies it.
        depth: A formula that is positive below the line, such as "8 + 0.2*x - y".
    """

    words: ClassVar[str] = "force per volume below a line"

    depth: str = ""

    def cells_below(self, corners: Floats) -> npt.NDArray[np.bool_]:
        """Return which cells are below the line. Not collective.

        Args:
            corners: Vertices of the cells, shape (n, d + 1, d).

        Raises:
            InputError: If the line divides a cell.
        """
        found = enclosed(self.depth, corners, f"the load on '{self.on}'")
        if found is None:
            raise InputError(
                f"the depth of the load on '{self.on}' is {self.depth!r}; give it by sums,"
                " products, abs, minimum and maximum."
            )
        low, high = found
        noticed = 1e-9 * np.abs(corners).max(initial=0.0)
        divided = (low.min(axis=1) < -noticed) & (high.max(axis=1) > noticed)
        if divided.any():
            at = place_of(corners[np.argmax(divided)].mean(axis=0))
            raise InputError(
                f"the line below which '{self.on}' has another weight divides cells, one at {at};"
                " give a mesh with edges along it, or draw the ground in the case by [[region]]."
            )
        below: npt.NDArray[np.bool_] = high.max(axis=1) > noticed
        return below


@dataclass(frozen=True)
class PorePressure(SpreadLoad):
    """Pressure p of water in the pores of a volume, whose law is one of effective stresses.

    The total stress is σ − p δ (tension is positive), so that p does the work ∫ p div v.

    Args:
        on: Physical volume.
        value: The pressure (stress), a number or formula.
        name: Name in messages.
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

        if tagged_mesh.is_thin:
            raise InputError(
                f"the pore pressure in '{self.on}' is of bodies whose change of volume is known,"
                " and sheets in plane stress grow thicker; give kind = 'plane-strain'."
            )
        return value * divergence(tagged_mesh.kinematics, v)

    def at_corners(self, corners: Floats) -> Floats | None:
        """Return a function that is linear in each cell, at the vertices, shape (n, d + 1).

        None of a number or formula, which need not be linear in a cell. Not collective.

        Args:
            corners: Vertices of the cells, shape (n, d + 1, d).
        """
        return None


class CellField(Protocol):
    """A function that is linear in each cell of a mesh, and of the meshes that divide its cells."""

    def at_corners(self, corners: Floats) -> Floats:
        """Return it at the vertices of cells, shape (n, d + 1).

        Args:
            corners: Vertices of the cells, shape (n, d + 1, d).
        """


@dataclass(frozen=True)
class FieldPores(PorePressure):
    """Pore pressure that is a field on a mesh, such as that of water that flows.

    Args:
        on: Physical volume.
        value: Where the field comes from, in words.
        name: Name in messages.
        constant: Whether it acts in full at any load factor; otherwise ζ multiplies it.
        field: The field (stress); None as long as there is no mesh.
    """

    field: CellField | None = None

    def at_corners(self, corners: Floats) -> Floats | None:
        """Return the field at the vertices of cells, shape (n, d + 1). Not collective.

        Args:
            corners: Vertices of the cells, shape (n, d + 1, d).

        Raises:
            InputError: If there is no field yet.
        """
        if self.field is None:
            raise InputError(
                f"the pore pressure in '{self.on}' is that of {self.value}, which is not known"
                " without a mesh; build the problem from the case."
            )
        return self.field.at_corners(corners)


@dataclass(frozen=True)
class EnclosedPores(PorePressure):
    """The same by a function that is linear in each cell, and not below the formula or not above.

    Args:
        on: Physical volume.
        value: The formula.
        name: Name in messages.
        constant: Whether it acts in full at any load factor; otherwise ζ multiplies it.
        side: "above" or "below", where the function is.
    """

    side: str = "above"

    def at_corners(self, corners: Floats) -> Floats | None:
        """Return it at the vertices of cells, shape (n, d + 1). Not collective.

        None where it has no such function.

        Args:
            corners: Vertices of the cells, shape (n, d + 1, d).
        """
        found = enclosed(self.value, corners, f"the load on '{self.on}'")
        return None if found is None else found[self.side == "above"]


@dataclass(frozen=True)
class Force(Load):
    """Force and moment on a surface: spread over it, or on a rigid one that is free to move.

    On a surface that is not rigid it is the traction that is linear in the coordinates and has this
    force and moment on the mesh (:mod:`perfplast_fenicsx.problem.assembled.spread_forces`).

    Args:
        on: The surface.
        value: The whole force on a surface, one number a direction; in the plane for each unit of
            depth. It is spread linearly, or acts on a rigid surface that is free to move.
        moment: With or in place of a force, a number in the plane, one for each axis in space.
        point: Where the force acts, and what the moment is about (length); without, the origin of
            rigid surfaces, and the centroid of others.
        name: Name in messages.
        constant: Whether it acts in full at any load factor; otherwise ζ multiplies it.
    """

    words: ClassVar[str] = "force"
    quantities: ClassVar[Quantities] = MappingProxyType({"value": "force", "moment": "work"})

    on: str
    value: Sequence[float] = ()
    moment: float | Sequence[float] = ()
    point: Sequence[float] = ()
    name: str = ""
    constant: bool = False


@dataclass(frozen=True)
class Bearing(Load):
    """The force of a pin in a bore, a pressure that follows the cosine and pushes only.

    Args:
        on: Physical surface, such as a whole bore or half of one.
        value: The whole force of a pin or shaft on its bore, one number a direction; in the plane
            for each unit of depth. The pressure is that of the cosine, only where the surface faces
            the force, and as large as makes the force on the mesh exact.
        name: Name in messages.
        constant: Whether it acts in full at any load factor; otherwise ζ multiplies it.
    """

    words: ClassVar[str] = "bearing force"
    quantities: ClassVar[Quantities] = MappingProxyType({"value": "force"})

    on: str
    value: Sequence[float]
    name: str = ""
    constant: bool = False


@dataclass(frozen=True)
class CosinePressure(SpreadLoad):
    """A :class:`Bearing` on a mesh: the pressure p = max(0, −a·n).

    Args:
        on: Physical surface.
        value: The largest pressure, in its direction: a (stress).
        name: Name in messages.
        constant: Whether it acts in full at any load factor; otherwise ζ multiplies it.
    """

    words: ClassVar[str] = "bearing pressure"
    quantities: ClassVar[Quantities] = MappingProxyType({"value": "stress"})

    on: str
    value: Sequence[float]
    name: str = ""
    constant: bool = False

    def work(self, value: Any, v: Any, tagged_mesh: "TaggedMesh") -> Any:
        """−max(0, −a·n) n·v."""
        import ufl

        normal = ufl.FacetNormal(tagged_mesh.mesh)
        pressure = ufl.max_value(-ufl.inner(value, normal), 0.0)
        return ufl.inner(-pressure * normal, v)


BOUNDED = (
    "strict bounds are for tractions and pressures that are linear on each facet, pressures in"
    " pores that are linear in each cell, and forces per volume that are numbers; give one of"
    " these, or seek the limit load of the mesh alone (control = 'work', until = 'limit')."
)
"""The refusal of loads that strict bounds do not accept."""

LOADS: dict[str, type[Any]] = {
    "traction": Traction,
    "pressure": Pressure,
    "body_force": BodyForce,
    "pore_pressure": PorePressure,
    "force": Force,
    "bearing_force": Bearing,
}
"""Kinds of loads by their name in case files."""

OTHERS: dict[str, type[Any]] = {"body_force_below": ForceBelow}
"""Kinds of loads that the program makes itself, by their name in results."""

ON_SURFACES = (Traction, Pressure, CosinePressure)
"""Loads whose tractions strict bounds and proofs know, where they are linear on facets."""


def load_kinds() -> dict[str, type[Any]]:
    """Return all kinds of loads by their name in results, those of packages too."""
    return {**LOADS, **OTHERS}


def kind_of(load: Load) -> str:
    """Return how files call a load's kind; the name of its class where it is in no file."""
    own = PorePressure if isinstance(load, FieldPores) else type(load)
    known = (kind for kind, cls in load_kinds().items() if cls is own)
    return next(known, type(load).__name__)


def is_known(load: Load) -> bool:
    """Return whether a load is of the program's own kinds, and none of a user's."""
    return type(load) in (*load_kinds().values(), *ON_SURFACES, FieldPores, EnclosedPores)


def is_uniform(load: Load) -> bool:
    """Return whether a load is given as numbers."""
    return np.asarray(load.value).dtype.kind in "fiu"


def is_bounded(load: Load) -> bool:
    """Return whether strict bounds know a load: all but forces per volume that are formulas."""
    return type(load) in (*ON_SURFACES, PorePressure, FieldPores, EnclosedPores, Force) or (
        type(load) in (BodyForce, ForceBelow) and is_uniform(load)
    )


def check_bounded(load: Load) -> None:
    """Refuse a load that strict bounds and proofs do not know.

    Raises:
        InputError: If it is of another kind, or a force per volume that is a formula.
    """
    if not is_bounded(load):
        kind = kind_of(load).replace("_", " ")
        what = "force per volume that is a formula" if type(load) is BodyForce else kind
        raise InputError(f"the load on '{load.on}' is a {what}, and {BOUNDED}")
