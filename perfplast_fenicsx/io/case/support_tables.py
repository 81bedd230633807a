"""Read ``[[support]]``, ``[[rigid_surface]]`` and ``[[contact]]``, which can prescribe motions."""

from collections.abc import Callable
from dataclasses import dataclass, field

from perfplast_fenicsx.contact.declared.contact import INTERFACES, Contact
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.io.case.schema import Table, at, choose, convert
from perfplast_fenicsx.problem.declared.supports import AXES, RigidSurface, Support, Turn


@dataclass(frozen=True)
class SupportTable:
    """Prescribed displacement components on a surface.

    Args:
        on: Physical surface.
        components: The held components: any of the letters x, y, z; the default is all of them.
            With "normal", only the component normal to a flat surface of any orientation is held,
            and the surface can slide tangentially, as at a plane of symmetry. If a value is given,
            the surface may be curved.
        value: Prescribed displacement (length), such as a settlement; with "normal" it is positive
            along the outward normal. Give a number, or a formula in x, y, z such as "0.01*y". The
            default is 0.
        constant: Whether the displacement is the same at any load factor. With control =
            "displacement", and in stages that name the support, the factor multiplies the
            displacement unless constant is true. In other cases the displacement is always
            constant.
        name: Name of the support for results and stages; the default is the name of the surface.
    """

    on: str
    components: str = AXES
    value: float | str = 0.0
    constant: bool | None = None
    name: str = ""

    def support(self, driven: bool) -> Support:
        """Return the support that the table defines.

        Raises:
            InputError: If ``constant`` is false, but the loading does not move this surface.
        """
        constant = _stays(self.constant, driven, f"the support on '{self.on}'")
        return Support(self.on, self.components, self.value, constant, self.name)


@dataclass(frozen=True)
class RigidSurfaceTable:
    """A surface that is glued to a rigid plate, such as the rough base of a footing.

    Without displacement and rotation the surface is free to move as a rigid body, and loads may act
    on it, including a ``force``.

    Args:
        on: Physical surface.
        point: Centre of the rotation (length; 2 or 3 numbers); the default is the origin.
        displacement: Displacement of this point (length; 2 or 3 numbers); the default is 0.
        rotation: Angle of rotation (rad): one number in the plane, and one for each axis in 3D. The
            default is 0 if a displacement is given.
        components: Displacement components that the prescribed motion fixes, as letters of x, y, z;
            the default is all. For example, omit the component along a twisted bar so that its end
            can warp.
        constant: As for supports.
        name: As for supports.
        held: Directions, as letters of x, y, z, in which a free surface cannot move, as at a plane
            of symmetry. Such a surface does not rotate either.
    """

    on: str
    point: list[float] = field(default_factory=list)
    displacement: list[float] | None = None
    rotation: float | list[float] | None = None
    components: str = AXES
    constant: bool | None = None
    name: str = ""
    held: str = ""

    def surface(self, driven: bool) -> RigidSurface:
        """Return the rigid surface that the table defines.

        Raises:
            InputError: If ``constant`` is false, but the loading does not move this surface.
        """
        constant = _stays(self.constant, driven, f"the rigid surface '{self.on}'")
        turn: Turn = () if self.rotation is None else self.rotation
        motion = (self.displacement or (), turn, self.components, constant)
        return RigidSurface(self.on, self.point, *motion, self.name, self.held)


def read_contact(table: Table, moved: Callable[[str, str], bool], place: str) -> Contact:
    """Return the contact that a table defines.

    Args:
        table: The table ``[[contact]]``.
        moved: See :meth:`~perfplast_fenicsx.controls.control.Control.moved`.
        place: Place in the input, for messages.

    Raises:
        InputError: If a key or value is not valid, or if ``constant`` is false but the loading
            moves nothing.
    """
    _, kind, rest = choose(table, "interface", INTERFACES, place, default="friction")
    contact = convert(rest, kind, place)
    with at(place):
        what = f"the contact of '{contact.primary}' and '{contact.secondary}'"
        _stays(contact.constant, moved(contact.name, contact.on), what)
    return contact


def _stays(constant: bool | None, driven: bool, what: str) -> bool:
    """Return whether the prescribed motion of an object is the same at any load factor.

    Raises:
        InputError: If ``constant`` is false, but the loading does not move this surface.
    """
    if not driven and constant is False:
        raise InputError(
            f"{what} has constant = false, but the loading does not move it; give control = "
            "'displacement' or a stage that names it, or remove constant."
        )
    return not driven if constant is None else constant
