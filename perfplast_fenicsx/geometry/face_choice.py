"""Which faces of a geometry file have a name that a user gives them."""

import math
from dataclasses import dataclass

from perfplast_fenicsx.errors import InputError, nearest

AXES = "xyz"


@dataclass(frozen=True)
class NamedFace:
    """A name for free faces or curves: give one of plane, point, radius, number and colour.

    Args:
        name: What the faces are called, for supports, loads and contacts.
        plane: A coordinate and its value (length), such as {z = 40.0}: all flat faces in this
            plane.
        point: A point on the face (length; 2 or 3 numbers).
        radius: Of cylindrical faces (in the plane, of round curves): all that have it (length).
        about: With a radius: a point on the axis of the cylinder (length; 2 or 3 numbers), where
            several have the same radius.
        number: As ``perfplast mesh`` lists the faces, and as in its picture.
        colour: Of faces of a STEP file that have another colour than most of their body: a word
            such as "red", or as perfplast mesh lists it, such as "#dd5228".
        body: Of which the faces are; of any without.
    """

    name: str
    plane: dict[str, float] | None = None
    point: list[float] | None = None
    radius: float | None = None
    about: list[float] | None = None
    number: int | None = None
    colour: str | None = None
    body: str = ""

    def __post_init__(self) -> None:
        kinds = ("plane", "point", "radius", "number", "colour")
        given = [kind for kind in kinds if getattr(self, kind) is not None]
        if not self.name.strip():
            raise InputError("name is empty; give the faces one.")
        if len(given) != 1:
            raise InputError(
                f"the face '{self.name}' has {' and '.join(given) or 'no place'}; give exactly one"
                " of plane, point, radius, number and colour."
            )
        if self.plane is not None:
            check_planes(f"plane of '{self.name}'", self.plane)
            if len(self.plane) != 1:
                raise InputError(
                    f"plane of '{self.name}' has {len(self.plane)} coordinates; give one, such as"
                    " {z = 40.0}, and name oblique faces by a point on them."
                )
        for what in ("point", "about"):
            place = getattr(self, what)
            if place is not None and not (len(place) in (2, 3) and all(map(math.isfinite, place))):
                raise InputError(
                    f"{what} = {place} of '{self.name}' is no point; give 2 or 3 numbers."
                )
        if self.radius is not None and not (self.radius > 0 and math.isfinite(self.radius)):
            raise InputError(f"radius of '{self.name}' must be positive, not {self.radius:g}.")
        if self.about is not None and self.radius is None:
            raise InputError(f"'{self.name}' has about, which goes with a radius; leave it out.")


def check_planes(what: str, planes: dict[str, float]) -> None:
    """Refuse what is no coordinate with a value.

    Raises:
        InputError: Naming it.
    """
    for axis, value in planes.items():
        if axis not in tuple(AXES):
            raise InputError(f"{what}: '{axis}' is no coordinate; {nearest(axis, AXES)}")
        if not math.isfinite(value):
            raise InputError(f"{what}: {axis} = {value} is not finite; give a number.")
