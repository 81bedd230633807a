"""Read tables that hold or move bodies: ``[[support]]``, ``[[rigid_surface]]``, ``[[contact]]``."""

from collections.abc import Callable
from dataclasses import dataclass, field

from perfplast_fenicsx.contact.declared.contact import INTERFACES, Contact
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.io.case.schema import Table, at, choose, convert
from perfplast_fenicsx.problem.declared.supports import AXES, RigidSurface, Support, Turn


@dataclass(frozen=True)
class SupportTable:
    """Prescribed displacement of some components on a surface.

    Args:
        on: Physical surface.
        components: Any of the letters x, y, z; the default holds all components of the mesh. Or
            "normal" for the component normal to a flat surface of any direction, which may then
            slide tangentially, as a plane of symmetry does. With a value the surface may be curved.
        value: Prescribed displacement (length), such as a settlement; with "normal" the
            displacement out of the body along the normal. A number, or a formula in x, y, z such as
            "0.01*y". The default is no displacement.
        constant: Whether the displacement is the same at any load factor. Under control =
            "displacement", and in stages that name the support, the factor multiplies the
            displacement unless this is true; otherwise it is always constant.
        name: Name in results and stages; by default the name of its surface.
    """

    on: str
    components: str = AXES
    value: float | str = 0.0
    constant: bool | None = None
    name: str = ""

    def support(self, driven: bool) -> Support:
        """Return the support, with or without motions that follow the load factor.

        Raises:
            InputError: If it should follow a loading without motions.
        """
        constant = _stays(self.constant, driven, f"the support on '{self.on}'")
        return Support(self.on, self.components, self.value, constant, self.name)


@dataclass(frozen=True)
class RigidSurfaceTable:
    """A surface glued to a rigid plate, such as the rough base of a footing.

    Without displacement and rotation it is free to move, and loads act on it, including a
    ``force``.

    Args:
        on: Physical surface.
        point: Centre of the rotation (length; 2 or 3 numbers); by default the origin.
        displacement: Displacement of that point (length; 2 or 3 numbers); by default 0.
        rotation: A number in the plane, one for each axis in space (rad); 0 if only a displacement
            is given.
        components: Letters of x, y, z that a prescribed motion holds; the default holds all. With
            only some of them, a bar that is twisted at its end may warp there.
        constant: As for supports.
        name: As for supports.
        held: Letters of x, y, z along which a free surface cannot move, as at a plane of symmetry.
            The surface then does not rotate either.
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
        """Return the surface, with or without motions that follow the load factor.

        Raises:
            InputError: If it should follow a loading without motions.
        """
        constant = _stays(self.constant, driven, f"the rigid surface '{self.on}'")
        turn: Turn = () if self.rotation is None else self.rotation
        motion = (self.displacement or (), turn, self.components, constant)
        return RigidSurface(self.on, self.point, *motion, self.name, self.held)


def read_contact(table: Table, moved: Callable[[str, str], bool], place: str) -> Contact:
    """Return a contact, whose overlap may follow the load factor.

    Args:
        table: Its table.
        moved: See :meth:`~perfplast_fenicsx.controls.control.Control.moved`.
        place: Place in the input, which messages name.

    Raises:
        InputError: If keys are wrong, or if it should follow a loading without motions.
    """
    _, kind, rest = choose(table, "interface", INTERFACES, place, default="friction")
    contact = convert(rest, kind, place)
    with at(place):
        what = f"the contact of '{contact.primary}' and '{contact.secondary}'"
        _stays(contact.constant, moved(contact.name, contact.on), what)
    return contact


def _stays(constant: bool | None, driven: bool, what: str) -> bool:
    """Return whether a moved object keeps its place at any load factor.

    Raises:
        InputError: If it should follow a loading without motions.
    """
    if not driven and constant is False:
        raise InputError(
            f"{what} has constant = false, but nothing moves it: control = 'displacement' "
            "or stages that name it would; choose one of them, or remove constant."
        )
    return not driven if constant is None else constant
