"""Define the loads on named surfaces and volumes, one class for each kind of load.

A load has the class attributes of :class:`Load`. A load with a density on its surface or in its
volume also defines the integrand of its work L(v) (:class:`SpreadLoad`). Case files, units and
reports use these attributes, so a new load needs only its class and an entry in :data:`LOADS`.

The values of a load may be formulas in the coordinates, such as ``"10*maximum(8 - y, 0)"``
(:mod:`perfplast_fenicsx.formulas`). The program interpolates a formula at the nodes of quadratic
cells, so a formula of degree 2 is exact in straight cells.
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
from perfplast_fenicsx.spatial_fields import SpatialField, field_of

if TYPE_CHECKING:
    from dolfinx import fem

    from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh


Formula = float | str
"""A number, or a formula in x, y, z."""

Quantities = Mapping[str, str]


class Load:
    """The interface of a load.

    Attributes:
        words: Name of the kind in reports.
        quantities: Keys of :meth:`units.Units.table` for the units, by field. The fields are
            ``value``, which case files name after the kind of load, and any further field that
            loads the body, such as ``moment``.
        in_volume: Whether ``on`` is a volume rather than a surface.
        on: Physical name of the surface or volume.
        value: A number or formula, or one of them for each direction.
        name: Name in messages; in results and stages it is ``on`` by default.
        constant: Whether the load acts in full at any load factor; if not, ζ or a factor of
            stages multiplies it.
    """

    words: ClassVar[str]
    quantities: ClassVar[Quantities]
    in_volume: ClassVar[bool] = False

    on: str
    value: Formula | Sequence[Formula]
    name: str
    constant: bool


class SpreadLoad(Load):
    """A load with a density on its surface or in its volume.

    Attributes:
        scalar: Whether ``value`` is one number or formula instead of one for each direction.
    """

    scalar: ClassVar[bool] = False

    def work(self, value: Any, v: Any, tagged_mesh: "TaggedMesh") -> Any:
        """Return the work per area or volume, which is the integrand of L(v).

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
        on: Physical name of the surface.
        value: The force per area (stress), a number or formula for each direction.
        name: Name in messages; in results and stages it is ``on`` by default.
        constant: Whether the load acts in full at any load factor; if not, ζ or a factor of
            stages multiplies it.
        total: Whether the value is the total force on the surface, which the program distributes
            evenly over the area in the mesh.
    """

    words: ClassVar[str] = "traction"
    quantities: ClassVar[Quantities] = MappingProxyType({"value": "stress"})

    on: str
    value: Sequence[Formula]
    name: str = ""
    constant: bool = False
    total: bool = False

    def work(self, value: Any, v: Any, tagged_mesh: "TaggedMesh") -> Any:
        """Return the work of the traction per area, t·v."""
        import ufl

        return ufl.inner(value, v)


@dataclass(frozen=True)
class Pressure(SpreadLoad):
    """Pressure on a surface.

    Args:
        on: Physical name of the surface.
        value: The pressure (stress), a number or formula; a positive pressure pushes on the body.
        name: Name in messages; in results and stages it is ``on`` by default.
        constant: Whether the load acts in full at any load factor; if not, ζ or a factor of
            stages multiplies it.
    """

    words: ClassVar[str] = "pressure"
    quantities: ClassVar[Quantities] = MappingProxyType({"value": "stress"})
    scalar: ClassVar[bool] = True

    on: str
    value: Formula
    name: str = ""
    constant: bool = False

    def work(self, value: Any, v: Any, tagged_mesh: "TaggedMesh") -> Any:
        """Return the work of the pressure per area, −p n·v."""
        import ufl

        return ufl.inner(-value * ufl.FacetNormal(tagged_mesh.mesh), v)


@dataclass(frozen=True)
class BodyForce(SpreadLoad):
    """Force per volume.

    Args:
        on: Physical name of the volume.
        value: The force per volume, a number or formula for each direction.
        name: Name in messages; in results and stages it is ``on`` by default.
        constant: Whether the load acts in full at any load factor; if not, ζ or a factor of
            stages multiplies it.
    """

    words: ClassVar[str] = "force per volume"
    quantities: ClassVar[Quantities] = MappingProxyType({"value": "force_density"})
    in_volume: ClassVar[bool] = True

    on: str
    value: Sequence[Formula]
    name: str = ""
    constant: bool = False

    def work(self, value: Any, v: Any, tagged_mesh: "TaggedMesh") -> Any:
        """Return the work of the force per volume, f·v."""
        import ufl

        return ufl.inner(value, v)


@dataclass(frozen=True)
class ForceBelow(BodyForce):
    """Force per volume in the cells of a volume below a line, such as a water table.

    Args:
        on: Physical name of the volume.
        value: The force per volume, a number for each direction.
        name: Name in messages; in results and stages it is ``on`` by default.
        constant: Whether the load acts in full at any load factor; if not, ζ or a factor of
            stages multiplies it.
        depth: Formula that is positive below the line, such as "8 + 0.2*x - y".
    """

    words: ClassVar[str] = "force per volume below a line"

    depth: str = ""

    def cells_below(self, corners: Floats) -> npt.NDArray[np.bool_]:
        """Return which cells are below the line. Not collective.

        Args:
            corners: Vertices of the cells, shape (n, d + 1, d).

        Raises:
            InputError: If the formula is not supported, or if the line divides a cell.
        """
        found = enclosed(self.depth, corners, f"the load on '{self.on}'")
        if found is None:
            raise InputError(
                f"the depth of the load on '{self.on}', {self.depth!r}, is not a supported "
                "formula; give a formula of sums, products, abs, minimum and maximum."
            )
        low, high = found
        noticed = 1e-9 * np.abs(corners).max(initial=0.0)
        divided = (low.min(axis=1) < -noticed) & (high.max(axis=1) > noticed)
        if divided.any():
            at = place_of(corners[np.argmax(divided)].mean(axis=0))
            raise InputError(
                f"the line below which '{self.on}' has a different weight divides cells, one of "
                f"them at {at}; give a mesh with edges along the line, or draw the ground in the "
                "case with [[region]]."
            )
        below: npt.NDArray[np.bool_] = high.max(axis=1) > noticed
        return below


@dataclass(frozen=True)
class PorePressure(SpreadLoad):
    """Pressure p of water in the pores of a volume, whose law uses effective stresses.

    The total stress is σ − p δ (tension is positive), so p does the work ∫ p div v.

    Args:
        on: Physical name of the volume.
        value: The pressure (stress), a number or formula.
        name: Name in messages; in results and stages it is ``on`` by default.
        constant: Whether the load acts in full at any load factor; if not, ζ or a factor of
            stages multiplies it.
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
        """Return the work of the pore pressure per volume, p div v."""
        from perfplast_fenicsx.mesh.kinematics import divergence

        if tagged_mesh.is_thin:
            raise InputError(
                f"the pore pressure in '{self.on}' needs a body whose volume change is "
                "known, but plane stress allows any thickness change; give kind = "
                "'plane-strain'."
            )
        return value * divergence(tagged_mesh.kinematics, v)

    @classmethod
    def from_function(
        cls, on: str, function: "fem.Function", name: str = "", constant: bool = True
    ) -> "FieldPores":
        """Return a DOLFINx function as a pore pressure. Collective.

        Args:
            on: Physical name of the volume.
            function: Continuous pressure (stress) of degree 1, on the mesh of the bodies or on a
                mesh whose cells contain the cells of the bodies.
            name: Name in messages; in results and stages it is ``on`` by default.
            constant: Whether the load acts in full at any load factor; if not, ζ or a factor of
                stages multiplies it.

        Raises:
            InputError: As for :func:`perfplast_fenicsx.spatial_fields.field_of`.
        """
        field = LinearInCells(field_of(function))
        return FieldPores(on, f"the function '{function.name}'", name, constant, field)

    def at_corners(self, corners: Floats) -> Floats | None:
        """Return the values of a cellwise linear pressure at the vertices, shape (n, d + 1).

        Return None for a number or formula, which need not be linear in a cell. Not collective.

        Args:
            corners: Vertices of the cells, shape (n, d + 1, d).
        """
        return None


class CellField(Protocol):
    """A function that is linear in each cell of a mesh, and of meshes that divide these cells."""

    def at_corners(self, corners: Floats) -> Floats:
        """Return the values of the function at the vertices of cells, shape (n, d + 1).

        Args:
            corners: Vertices of the cells, shape (n, d + 1, d).
        """


@dataclass(frozen=True)
class LinearInCells:
    """A field that can be evaluated only in cells in which it is linear.

    Args:
        field: The field.
    """

    field: SpatialField

    def at_corners(self, corners: Floats) -> Floats:
        """Return the values of the field at the vertices of cells, shape (n, d + 1).

        Args:
            corners: Vertices of the cells, shape (n, d + 1, d).

        Raises:
            InputError: If the field is not linear in a cell, or has no value in it.
        """
        low, high = self.field.between(corners, "the pore pressure")
        if (low != high).any():
            where = place_of(corners.mean(axis=1)[np.argmax((low != high).any(axis=1))])
            raise InputError(
                f"the pore pressure of {self.field.in_words()} is not linear in the cell at "
                f"{where}; give a function on the mesh of the bodies."
            )
        return low


@dataclass(frozen=True)
class FieldPores(PorePressure):
    """Pore pressure as a field on a mesh, such as the pressure in seepage.

    Args:
        on: Physical name of the volume.
        value: Origin of the field, in words.
        name: Name in messages; in results and stages it is ``on`` by default.
        constant: Whether the load acts in full at any load factor; if not, ζ or a factor of
            stages multiplies it.
        field: The field (stress); None before the mesh exists.
    """

    field: CellField | None = None

    def at_corners(self, corners: Floats) -> Floats | None:
        """Return the values of the field at the vertices of cells, shape (n, d + 1).

        Not collective.

        Args:
            corners: Vertices of the cells, shape (n, d + 1, d).

        Raises:
            InputError: If the field does not exist yet.
        """
        if self.field is None:
            raise InputError(
                f"the pore pressure in '{self.on}' comes from {self.value}, which needs a mesh; "
                "build the problem from the case."
            )
        return self.field.at_corners(corners)


@dataclass(frozen=True)
class EnclosedPores(PorePressure):
    """A pore pressure as a cellwise linear function that bounds its formula from one side.

    Args:
        on: Physical name of the volume.
        value: The formula.
        name: Name in messages; in results and stages it is ``on`` by default.
        constant: Whether the load acts in full at any load factor; if not, ζ or a factor of
            stages multiplies it.
        side: "above" if the function is nowhere below the formula, "below" if it is nowhere above
            the formula.
    """

    side: str = "above"

    def at_corners(self, corners: Floats) -> Floats | None:
        """Return the values of the bounding function at the vertices, shape (n, d + 1).

        Not collective. Return None if :func:`formulas.enclosed` cannot bound the formula.

        Args:
            corners: Vertices of the cells, shape (n, d + 1, d).
        """
        found = enclosed(self.value, corners, f"the load on '{self.on}'")
        return None if found is None else found[self.side == "above"]


@dataclass(frozen=True)
class Force(Load):
    """Force and moment on a surface: distributed over it, or acting on a free rigid surface.

    On a surface that is not rigid, the force becomes the traction that is linear in the coordinates
    and has this resultant on the mesh (:mod:`perfplast_fenicsx.problem.assembled.spread_forces`).

    Args:
        on: Physical name of the surface.
        value: The total force (force; in plane meshes per unit of depth), one number for each
            direction. The program distributes it linearly, or applies it to a rigid surface that is
            free to move.
        moment: Moment in addition to the force or without a force (moment; in plane meshes per unit
            of depth): a number in plane meshes, one for each axis in 3D.
        point: Point where the force acts and about which the moment is taken (length). By default
            the origin for rigid surfaces, and the centroid for other surfaces.
        name: Name in messages; in results and stages it is ``on`` by default.
        constant: Whether the load acts in full at any load factor; if not, ζ or a factor of
            stages multiplies it.
    """

    words: ClassVar[str] = "force"
    quantities: ClassVar[Quantities] = MappingProxyType({"value": "force", "moment": "work"})

    on: str
    value: Sequence[float] = ()
    moment: float | Sequence[float] = ()
    point: Sequence[float] = ()
    name: str = ""
    constant: bool = False

    def vectors(self, gdim: int) -> tuple[Floats, Floats, Floats]:
        """Return value, moment and point as arrays, shapes (gdim,), (1 or 3,) and (gdim,).

        Numbers that are missing are zeros.

        Raises:
            InputError: If a vector does not fit a mesh of dimension ``gdim``.
        """
        what = f"of the force on '{self.on}'"
        value = fitting(f"value {what}", self.value, gdim)
        moment = fitting(f"moment {what}", self.moment, 2 * gdim - 3)
        return value, moment, fitting(f"point {what}", self.point, gdim)


@dataclass(frozen=True)
class Bearing(Load):
    """The force of a pin in a bore: a pressure with a cosine distribution that only pushes.

    Args:
        on: Physical name of the surface, such as a whole bore or half of it.
        value: The total force of a pin or shaft on its bore (force; in plane meshes per unit of
            depth), one number for each direction. The pressure has a cosine distribution and acts
            only where the surface faces the force. The program scales the pressure so that its
            resultant on the mesh is exact.
        name: Name in messages; in results and stages it is ``on`` by default.
        constant: Whether the load acts in full at any load factor; if not, ζ or a factor of
            stages multiplies it.
    """

    words: ClassVar[str] = "bearing force"
    quantities: ClassVar[Quantities] = MappingProxyType({"value": "force"})

    on: str
    value: Sequence[float]
    name: str = ""
    constant: bool = False

    def vector(self, gdim: int) -> Floats:
        """Return the force as an array, shape (gdim,).

        Raises:
            InputError: If the force does not fit a mesh of dimension ``gdim``.
        """
        return fitting(f"value of the bearing force on '{self.on}'", self.value, gdim)


@dataclass(frozen=True)
class CosinePressure(SpreadLoad):
    """A :class:`Bearing` on a mesh: the pressure p = max(0, −a·n).

    Args:
        on: Physical name of the surface.
        value: The vector a (stress): the largest pressure times its direction.
        name: Name in messages; in results and stages it is ``on`` by default.
        constant: Whether the load acts in full at any load factor; if not, ζ or a factor of
            stages multiplies it.
    """

    words: ClassVar[str] = "bearing pressure"
    quantities: ClassVar[Quantities] = MappingProxyType({"value": "stress"})

    on: str
    value: Sequence[float]
    name: str = ""
    constant: bool = False

    def work(self, value: Any, v: Any, tagged_mesh: "TaggedMesh") -> Any:
        """Return the work of the pressure per area, −max(0, −a·n) n·v."""
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
"""The end of the message for a load that strict bounds do not accept."""

LOADS: dict[str, type[Any]] = {
    "traction": Traction,
    "pressure": Pressure,
    "body_force": BodyForce,
    "pore_pressure": PorePressure,
    "force": Force,
    "bearing_force": Bearing,
}
"""Kinds of loads by their names in case files."""

OTHERS: dict[str, type[Any]] = {"body_force_below": ForceBelow}
"""Kinds of loads that only the program creates, by their names in results."""

ON_SURFACES = (Traction, Pressure, CosinePressure)
"""Loads whose tractions strict bounds and proofs accept if they are linear on facets."""


def load_kinds() -> dict[str, type[Any]]:
    """Return all kinds of loads by their names in results, including kinds from packages."""
    return {**LOADS, **OTHERS}


def kind_of(load: Load) -> str:
    """Return the name of a load's kind in files, or the name of its class if files have none."""
    own = PorePressure if isinstance(load, FieldPores) else type(load)
    known = (kind for kind, cls in load_kinds().items() if cls is own)
    return next(known, type(load).__name__)


def is_known(load: Load) -> bool:
    """Return whether the class of a load has a name in results, or belongs to this module."""
    return type(load) in (*load_kinds().values(), *ON_SURFACES, FieldPores, EnclosedPores)


def is_uniform(load: Load) -> bool:
    """Return whether the values of a load are numbers."""
    return np.asarray(load.value).dtype.kind in "fiu"


def is_bounded(load: Load) -> bool:
    """Return whether strict bounds accept the class of a load; body forces must also be numbers."""
    return type(load) in (*ON_SURFACES, PorePressure, FieldPores, EnclosedPores, Force) or (
        type(load) in (BodyForce, ForceBelow) and is_uniform(load)
    )


def check_bounded(load: Load) -> None:
    """Refuse a load that strict bounds and proofs do not accept.

    Raises:
        InputError: If the load is of another kind, or if it is a body force that is a formula.
    """
    if not is_bounded(load):
        kind = kind_of(load).replace("_", " ")
        what = "force per volume that is a formula" if type(load) is BodyForce else kind
        raise InputError(f"the load on '{load.on}' is a {what}, but {BOUNDED}")


def scaled(load: Load, factor: float) -> Load:
    """Return the load with all its values multiplied by a factor.

    Args:
        load: Load whose numbers and formulas the function multiplies.
        factor: Factor of any sign. A negative factor changes where a bearing pressure acts in the
            bore.
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


def fitting(what: str, value: float | Sequence[float], size: int) -> Floats:
    """Return ``value`` as an array of ``size`` finite numbers; zeros if the value is missing.

    Raises:
        InputError: If the value does not fit; the message contains ``what``.
    """
    numbers: Floats = np.atleast_1d(np.asarray(value, dtype=np.float64))
    if not numbers.size:
        return np.zeros(size)
    if numbers.shape != (size,) or not np.isfinite(numbers).all():
        raise InputError(
            f"{what} is {numbers.tolist()}, which does not fit the mesh; give {size} finite"
            f" number{'s' if size > 1 else ''}."
        )
    return numbers
