"""Which faces of a geometry file have a name that a user gives them."""

import math
from dataclasses import dataclass

from perfplast_fenicsx.errors import InputError, nearest

AXES = "xyz"


@dataclass(frozen=True)
class NamedFace:
    """A name for free faces or curves, by one of the places, marks and names below.

    A face keeps the names that it has besides, and may have several.

    Args:
        name: Name of the faces, for supports, loads and contacts.
        plane: A coordinate and its value (length), such as {z = 40.0}: all flat faces in this
            plane.
        point: A point on the face (length; 2 or 3 numbers): the one face in which it lies.
        angle: With a point (degrees, below 90): also the faces that are reached from its face
            across edges with a smaller angle between tangents. Two halves of a bore are an example.
        radius: Radius of cylindrical faces (in the plane, of round curves): all that have it
            (length).
        about: With a radius: a point on the axis of the cylinder (length; 2 or 3 numbers), where
            several have the same radius.
        number: As ``perfplast mesh`` lists faces and sets of faces, and as in its picture.
        colour: Colour of faces of a STEP file that have another colour than most of their body: a
            word such as "red", or as perfplast mesh lists it, such as "#dd5228".
        label: Label of faces of a STEP file that have labels of their own, as perfplast mesh lists
            it.
        box: Two opposite corners (length; 2 or 3 numbers each): all faces that lie within.
        faces: Names of faces or of sets of faces, as perfplast mesh lists them or as they are given
            before.
        body: Of which the faces are; of any without.
    """

    name: str
    plane: dict[str, float] | None = None
    point: list[float] | None = None
    angle: float | None = None
    radius: float | None = None
    about: list[float] | None = None
    number: int | None = None
    colour: str | None = None
    label: str | None = None
    box: list[list[float]] | None = None
    faces: list[str] | None = None
    body: str = ""

    def __post_init__(self) -> None:
        kinds = ("plane", "point", "radius", "number", "colour", "label", "box", "faces")
        given = [kind for kind in kinds if getattr(self, kind) is not None]
        if not self.name.strip():
            raise InputError("name is empty; give the faces one.")
        if len(given) != 1:
            raise InputError(
                f"the face '{self.name}' has {' and '.join(given) or 'no place'}; give exactly one"
                f" of {', '.join(kinds[:-1])} and {kinds[-1]}."
            )
        if self.plane is not None:
            check_planes(f"plane of '{self.name}'", self.plane)
            if len(self.plane) != 1:
                raise InputError(
                    f"plane of '{self.name}' has {len(self.plane)} coordinates; give one, such as"
                    " {z = 40.0}, and name oblique faces by a point on them."
                )
        places = {"point": self.point, "about": self.about}
        places |= {f"corner {k} of box": at for k, at in enumerate(self.box or (), start=1)}
        for what, place in places.items():
            if place is not None and not (len(place) in (2, 3) and all(map(math.isfinite, place))):
                raise InputError(
                    f"{what} = {place} of '{self.name}' is not a point; give 2 or 3 numbers."
                )
        if self.box is not None and len(self.box) != 2:
            raise InputError(
                f"box of '{self.name}' has {len(self.box)} corners; give two opposite ones, such as"
                " [[0, 0, 0], [10, 5, 2]]."
            )
        if self.faces is not None and not self.faces:
            raise InputError(f"faces of '{self.name}' is empty; give at least one name.")
        if self.angle is not None and (self.point is None or not 0 < self.angle < 90):
            raise InputError(
                f"angle = {self.angle:g} of '{self.name}' goes with a point, and lies between 0 and"
                " 90 degrees; give both so, or leave it out."
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
            raise InputError(f"{what}: '{axis}' is not a coordinate; {nearest(axis, AXES)}")
        if not math.isfinite(value):
            raise InputError(f"{what}: {axis} = {value} is not finite; give a number.")
