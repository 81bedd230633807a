"""Define the loads, named by physical surface or volume, one class for each kind.

A load has the class attributes of :class:`Load`. A load that is spread over its surface or volume
also has the integrand of its work L(v) (:class:`SpreadLoad`). Case files, units, words and reports
read these attributes. A new load therefore needs only its class and an entry of :data:`LOADS`.

The fields of a load may be formulas in the coordinates, such as ``"10*maximum(8 - y, 0)"``
(:mod:`perfplast_fenicsx.formulas`). The program interpolates a formula at the nodes of quadratic
cells, so that degree 2 is exact.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.errors import InputError, place_of
from perfplast_fenicsx.formulas import enclosed

if TYPE_CHECKING:
    from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh


Formula = float | str
"""A number, or a formula in x, y, z."""

Quantities = Mapping[str, str]


class Load:
    """The interface of a load.

    Attributes:
        words: Name in reports.
        quantities: Units of its fields, by the keys of :meth:`units.Units.table`: of ``value``,
            which case files name after the load's kind, and of other fields that are loads on their
            own.
        in_volume: Whether ``on`` is a volume rather than a surface.
        on: Physical surface or volume.
        value: A number or formula, or one for each direction.
        name: Name in messages and stages.
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
        scalar: Whether ``value`` is one number or formula instead of one for each direction.
    """

    scalar: ClassVar[bool] = False

    def work(self, value: Any, v: Any, tagged_mesh: "TaggedMesh") -> Any:
        """Return the work per volume or area, the integrand of L(v).

        Args:
            value: Value of the load in UFL, a scalar or a vector.
            v: Displacement, a vector in UFL.
            tagged_mesh: The mesh.
        """
        raise NotImplementedError


@dataclass(frozen=True)
class Traction(SpreadLoad):
    """Force per area on a surface.

    Args:
        on: Physical surface.
        value: The force per area (stress), a number or formula for each direction.
        name: Name in messages.
        constant: Whether it acts in full at any load factor; otherwise ζ multiplies it.
        total: Whether the value is the total force on the surface, spread evenly over its area in
            the mesh.
    """

    words: ClassVar[str] = "traction"
    quantities: ClassVar[Quantities] = MappingProxyType({"value": "stress"})

    on: str
    value: Sequence[Formula]
    name: str = ""
    constant: bool = False
    total: bool = False

    def work(self, value: Any, v: Any, tagged_mesh: "TaggedMesh") -> Any:
        """Return t·v."""
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
        """Return −p n·v."""
        import ufl

        return ufl.inner(-value * ufl.FacetNormal(tagged_mesh.mesh), v)


@dataclass(frozen=True)
class BodyForce(SpreadLoad):
    """Force per volume.

    Args:
        on: Physical volume.
        value: The force per volume, a number or formula for each direction.
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
        """Return f·v."""
        import ufl

        return ufl.inner(value, v)


@dataclass(frozen=True)
class ForceBelow(BodyForce):
    """Force per volume in the cells of a volume that are below a line, such as a water table.

    Args:
        on: Physical volume.
        value: The force per volume, a number for each direction.
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
                f"the depth of the load on '{self.on}' is {self.depth!r}; give a formula "
                "of sums, products, abs, minimum and maximum."
            )
        low, high = found
        noticed = 1e-9 * np.abs(corners).max(initial=0.0)
        divided = (low.min(axis=1) < -noticed) & (high.max(axis=1) > noticed)
        if divided.any():
            at = place_of(corners[np.argmax(divided)].mean(axis=0))
            raise InputError(
                f"the line below which '{self.on}' has another weight divides cells, one "
                f"at {at}; give a mesh with edges along the line, or draw the ground in "
                "the case with [[region]]."
            )
        below: npt.NDArray[np.bool_] = high.max(axis=1) > noticed
        return below


@dataclass(frozen=True)
class PorePressure(SpreadLoad):
    """Pressure p of water in the pores of a volume, whose law uses effective stresses.

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
        """Return p div v."""
        from perfplast_fenicsx.mesh.kinematics import divergence

        if tagged_mesh.is_thin:
            raise InputError(
                f"the pore pressure in '{self.on}' needs a body whose volume change is "
                "known, but plane stress allows any thickness change; give kind = "
                "'plane-strain'."
            )
        return value * divergence(tagged_mesh.kinematics, v)

    def at_corners(self, corners: Floats) -> Floats | None:
        """Return a cellwise linear function by its values at the vertices, shape (n, d + 1).

        None for a number or formula, which need not be linear in a cell. Not collective.

        Args:
            corners: Vertices of the cells, shape (n, d + 1, d).
        """
        return None


class CellField(Protocol):
    """A function that is linear in each cell of a mesh and of the meshes that divide its cells."""

    def at_corners(self, corners: Floats) -> Floats:
        """Return the function at the vertices of cells, shape (n, d + 1).

        Args:
            corners: Vertices of the cells, shape (n, d + 1, d).
        """


@dataclass(frozen=True)
class FieldPores(PorePressure):
    """Pore pressure that is a field on a mesh, such as that of seepage.

    Args:
        on: Physical volume.
        value: The origin of the field, in words.
        name: Name in messages.
        constant: Whether it acts in full at any load factor; otherwise ζ multiplies it.
        field: The field (stress); None before there is a mesh.
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
                f"the pore pressure in '{self.on}' comes from {self.value}, which needs a "
                "mesh; build the problem from the case."
            )
        return self.field.at_corners(corners)


@dataclass(frozen=True)
class EnclosedPores(PorePressure):
    """A pore pressure replaced by a cellwise linear function that bounds its formula on one side.

    Args:
        on: Physical volume.
        value: The formula.
        name: Name in messages.
        constant: Whether it acts in full at any load factor; otherwise ζ multiplies it.
        side: "above" if the function is nowhere below the formula, "below" if it is nowhere above
            it.
    """

    side: str = "above"

    def at_corners(self, corners: Floats) -> Floats | None:
        """Return the bounding function at the vertices of cells, shape (n, d + 1). Not collective.

        None for cells without such a function.

        Args:
            corners: Vertices of the cells, shape (n, d + 1, d).
        """
        found = enclosed(self.value, corners, f"the load on '{self.on}'")
        return None if found is None else found[self.side == "above"]


@dataclass(frozen=True)
class Force(Load):
    """Force and moment on a surface: spread over it, or acting on a free rigid surface.

    On a surface that is not rigid, the force is the traction that is linear in the coordinates and
    has this resultant on the mesh (:mod:`perfplast_fenicsx.problem.assembled.spread_forces`).

    Args:
        on: The surface.
        value: The whole force on a surface (force; in the plane per unit of depth), one number for
            each direction. It is spread linearly, or acts on a rigid surface that is free to move.
        moment: Moment in addition to or instead of a force (moment; in the plane per unit of
            depth): a number in the plane, one for each axis in space.
        point: The point where the force acts and about which the moment is taken (length). The
            default is the origin for rigid surfaces and the centroid for others.
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
    """The force of a pin in a bore: a pressure that follows the cosine and only pushes.

    Args:
        on: Physical surface, such as a whole bore or half of one.
        value: The whole force of a pin or shaft on its bore (force; in the plane per unit of
            depth), one number for each direction. The pressure follows the cosine and acts where
            the surface faces the force. It is scaled so that its resultant on the mesh is exact.
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
        value: The largest pressure in its direction: a (stress).
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
        """Return −max(0, −a·n) n·v."""
        import ufl

        normal = ufl.FacetNormal(tagged_mesh.mesh)
        pressure = ufl.max_value(-ufl.inner(value, normal), 0.0)
        return ufl.inner(-pressure * normal, v)


BOUNDED = (
    "strict bounds accept tractions and pressures that are linear on each facet, pore "
    "pressures that are linear in each cell, and body forces that are numbers; give one "
    "of these, or compute only the limit load of the mesh (control = 'work', until = "
    "'limit')."
)
"""The end of the message that refuses a load for strict bounds."""

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
"""Kinds of loads that only the program creates, by their name in results."""

ON_SURFACES = (Traction, Pressure, CosinePressure)
"""Loads whose tractions strict bounds and proofs accept where they are linear on facets."""


def load_kinds() -> dict[str, type[Any]]:
    """Return all kinds of loads by their name in results, including those of packages."""
    return {**LOADS, **OTHERS}


def kind_of(load: Load) -> str:
    """Return the name of a load's kind in files, or the name of its class if files have none."""
    own = PorePressure if isinstance(load, FieldPores) else type(load)
    known = (kind for kind, cls in load_kinds().items() if cls is own)
    return next(known, type(load).__name__)


def is_known(load: Load) -> bool:
    """Return whether the program defines the kind of a load."""
    return type(load) in (*load_kinds().values(), *ON_SURFACES, FieldPores, EnclosedPores)


def is_uniform(load: Load) -> bool:
    """Return whether the fields of a load are numbers."""
    return np.asarray(load.value).dtype.kind in "fiu"


def is_bounded(load: Load) -> bool:
    """Return whether strict bounds accept a load: all except body forces that are formulas."""
    return type(load) in (*ON_SURFACES, PorePressure, FieldPores, EnclosedPores, Force) or (
        type(load) in (BodyForce, ForceBelow) and is_uniform(load)
    )


def check_bounded(load: Load) -> None:
    """Refuse a load that strict bounds and proofs do not accept.

    Raises:
        InputError: If it is of another kind, or if it is a body force that is a formula.
    """
    if not is_bounded(load):
        kind = kind_of(load).replace("_", " ")
        what = "force per volume that is a formula" if type(load) is BodyForce else kind
        raise InputError(f"the load on '{load.on}' is a {what}, and {BOUNDED}")


def scaled(load: Load, factor: float) -> Load:
    """Return the load with all its values multiplied by a factor.

    Args:
        load: A load; its numbers and formulas are multiplied.
        factor: Factor of any sign. A negative factor changes where the pressure of a pin in its
            bore acts.
    """
    given: Any = load
    names = [field.name for field in fields(given) if field.name in load.quantities]
    found: Load = replace(given, **{name: _times(getattr(load, name), factor) for name in names})
    return found


def _times(value: Any, factor: float) -> Any:
    if isinstance(value, str):
        return f"{factor!r}*({value})"
    if isinstance(value, Sequence):
        return [_times(one, factor) for one in value]
    return factor * value
