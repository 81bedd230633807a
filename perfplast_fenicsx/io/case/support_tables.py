"""Tables that hold or move bodies: ``[[support]]``, ``[[rigid_surface]]``, ``[[contact]]``."""

from collections.abc import Callable
from dataclasses import dataclass, field

from perfplast_fenicsx.contact.declared.contact import Contact
from perfplast_fenicsx.contact.declared.interfaces import INTERFACES
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.io.case.schema import Table, at, choose, convert
from perfplast_fenicsx.problem.declared.rigid_surface import RigidSurface, Turn
from perfplast_fenicsx.problem.declared.supports import AXES, Support


@dataclass(frozen=True)
class SupportTable:
    """Known displacement of some components on a surface.

    Args:
        on: Physical surface.
        components: Any of the letters x, y, z; the default holds all that the mesh has. Or
            "normal" for what is normal to a flat surface of any direction, which may slide along
            itself, as a plane of symmetry does. With a value the surface may be curved.
        value: Their displacement (length), such as a settlement, or that out of the body along the
            normal; a number, or a formula in x, y, z such as "0.01*y". There is none by default.
        constant: Whether it is the same at any load factor, as always but under control =
            "displacement" and in stages that name it: these multiply it unless this is true.
        name: Name in results and stages; by default that of its surface.
    """

    on: str
    components: str = AXES
    value: float | str = 0.0
    constant: bool | None = None
    name: str = ""

    def support(self, driven: bool) -> Support:
        """Return the support, where motions follow the load factor, or do not.

        Raises:
            InputError: If it is to follow where none does.
        """
        constant = _stays(self.constant, driven, f"the support on '{self.on}'")
        return Support(self.on, self.components, self.value, constant, self.name)


@dataclass(frozen=True)
class RigidSurfaceTable:
    """A surface that a rigid plate is glued to, such as the rough base of a footing.

    Without displacement and rotation it is free to move, and loads act on it, a ``force`` among
    them.

    Args:
        on: Physical surface.
        point: Centre of the rotation (length; 2 or 3 numbers); by default the origin.
        displacement: Displacement of that point (length; 2 or 3 numbers); by default 0.
        rotation: A number in the plane, one for each axis in space (rad), 0 if there is a
            displacement alone.
        components: Letters of x, y, z that a known motion holds; the default holds
            all. A bar that is twisted so by its end may warp there.
        constant: As for supports.
        name: As for supports.
        held: Letters of x, y, z along which a free surface cannot move, as at a plane of symmetry;
            it then does not turn either.
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
        """Return the surface, where motions follow the load factor, or do not.

        Raises:
            InputError: If it is to follow where none does.
        """
        constant = _stays(self.constant, driven, f"the rigid surface '{self.on}'")
        turn: Turn = () if self.rotation is None else self.rotation
        motion = (self.displacement or (), turn, self.components, constant)
        return RigidSurface(self.on, self.point, *motion, self.name, self.held)


def read_contact(table: Table, moved: Callable[[str, str], bool], place: str) -> Contact:
    """Return a contact, whose overlap may follow the load factor.

    Args:
        table: Its keys.
        moved: See :meth:`~perfplast_fenicsx.controls.control.Control.moved`.
        place: Place in the input, for messages.

    Raises:
        InputError: If keys are wrong, or it is to follow where none does.
    """
    _, kind, rest = choose(table, "interface", INTERFACES, place, default="friction")
    contact = convert(rest, kind, place)
    with at(place):
        what = f"the contact of '{contact.primary}' and '{contact.secondary}'"
        _stays(contact.constant, moved(contact.name, contact.on), what)
    return contact


def _stays(constant: bool | None, driven: bool, what: str) -> bool:
    """Whether what is moved keeps its place at any load factor, where motions follow it or do not.

    Raises:
        InputError: If it is to follow where none does.
    """
    if not driven and constant is False:
        raise InputError(
            f"{what} has constant = false, but nothing moves it: control = 'displacement' does,"
            " or stages that name it; choose one of them, or leave constant out."
        )
    return not driven if constant is None else constant
