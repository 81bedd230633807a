"""Declare how a geometry file is meshed, and which of its faces a user names."""

import math
from dataclasses import dataclass, field
from typing import Literal

from perfplast_fenicsx.errors import InputError, check_magnitude, nearest

AXES = "xyz"


@dataclass(frozen=True)
class NamedFace:
    """A name for free faces or curves, selected by one of the places, marks and names below.

    A face keeps its other names, and may have several.

    Args:
        name: Name of the faces, for supports, loads and contacts.
        plane: A coordinate and its value (length), such as {z = 40.0}: selects all flat faces in
            this plane.
        point: A point on the face (length; 2 or 3 numbers): selects the face that contains it.
        angle: With a point (degrees, below 90): selects also the faces that are reached across
            edges with a smaller angle between tangents. Two halves of a bore are an example.
        radius: Radius of cylindrical faces (in the plane, of circular curves): selects all with
            this radius (length).
        about: With a radius: a point on the axis of the cylinder (length; 2 or 3 numbers), if
            several cylinders have this radius.
        number: Number of a face or set of faces in the list and the picture of ``perfplast mesh``.
        colour: Colour of faces in a STEP file that differs from most of their body: a word such as
            "red", or a code from the list of perfplast mesh, such as "#dd5228".
        label: Label of faces with their own labels in a STEP file, as perfplast mesh lists it.
        box: Two opposite corners (length; 2 or 3 numbers each): selects all faces inside.
        faces: Names of faces or sets of faces, from the list of perfplast mesh or from earlier
            tables.
        body: Body of the faces; by default any body.
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
            raise InputError("name is empty; give the faces a name.")
        if len(given) != 1:
            raise InputError(
                f"the face '{self.name}' has {' and '.join(given) or 'no selection'}; give "
                f"exactly one of {', '.join(kinds[:-1])} and {kinds[-1]}."
            )
        if self.plane is not None:
            check_planes(f"plane of '{self.name}'", self.plane)
            if len(self.plane) != 1:
                raise InputError(
                    f"plane of '{self.name}' has {len(self.plane)} coordinates; give one, "
                    "such as {z = 40.0}, and select oblique faces by a point on them."
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
                f"angle = {self.angle:g} of '{self.name}' needs a point, and must lie "
                "between 0 and 90 degrees; correct it, or remove it."
            )
        if self.radius is not None and not (self.radius > 0 and math.isfinite(self.radius)):
            raise InputError(f"radius of '{self.name}' must be positive, not {self.radius:g}.")
        if self.about is not None and self.radius is None:
            raise InputError(f"'{self.name}' has about, which needs a radius; remove it.")


def check_planes(what: str, planes: dict[str, float]) -> None:
    """Refuse a key that is not a coordinate, or a value that is not finite.

    Raises:
        InputError: Naming the key.
    """
    for axis, value in planes.items():
        if axis not in tuple(AXES):
            raise InputError(f"{what}: '{axis}' is not a coordinate; {nearest(axis, AXES)}")
        if not math.isfinite(value):
            raise InputError(f"{what}: {axis} = {value} is not finite; give a number.")


@dataclass(frozen=True)
class MeshingOptions:
    """Options for meshing a geometry file.

    Args:
        size: Largest edge length, in the file's unit of length (for STEP files mm, whatever the
            file's own unit is); the default gives some ten thousand elements of equal size.
        sizes: Largest edge length of single bodies, by their names.
        curvature: Least number of elements around a full circle; 0 for no limit. The default is
            ten, or as many as make the areas of faces accurate to 1 %.
        order: Degree of the geometry, 1 or 2; 2 gives curved elements with quadratic edges.
        meshed: Whether touching bodies are meshed together, with matching nodes, or apart, each
            separately, with contact and ties between surfaces that do not match.
        shared: "glued" ties bodies that share faces in the drawing, as layers of one ground do,
            unless a contact or tie between them is given. "apart" leaves them apart.
        symmetry: Planes of symmetry, such as {x = 0.0, y = 0.0}: the half with larger coordinates
            is kept, and the cut is the surface ``symmetry_x``.
        overlap: Bodies may overlap by this share of the smaller one's volume; the later body in the
            file gets the common volume. Larger overlaps are refused.
        close_gaps: Faces of bodies at a smaller distance become one, at the place of either, so
            that the bodies touch. The value must be much smaller than thicknesses and edges.
        patience: Longest time for meshing (s).
        without: Names of bodies to leave out.
        face: Faces with names of their own.
    """

    size: float | None = None
    sizes: dict[str, float] = field(default_factory=dict)
    curvature: float | None = None
    order: Literal[1, 2] = 1
    meshed: Literal["together", "apart"] = "together"
    shared: Literal["glued", "apart"] = "glued"
    symmetry: dict[str, float] = field(default_factory=dict)
    overlap: float = 1e-3
    close_gaps: float = 0.0
    patience: float = 600.0
    without: list[str] = field(default_factory=list)
    face: list[NamedFace] = field(default_factory=list)

    def __post_init__(self) -> None:
        given = {"size": self.size} | {f"sizes of '{body}'": at for body, at in self.sizes.items()}
        given["patience"] = self.patience
        for name, size in given.items():
            if size is not None and not (size > 0 and math.isfinite(size)):
                what = "time" if name == "patience" else "length"
                raise InputError(f"{name} must be a positive {what}, not {size:g}.")
            check_magnitude(name, size or 1.0)
        if self.curvature is not None and not 0 <= self.curvature <= 360:
            raise InputError(
                f"curvature counts elements around a circle, 0 to 360, not {self.curvature:g}."
            )
        if not 0 <= self.overlap < 1:
            raise InputError(f"overlap must be a share from 0 to below 1, not {self.overlap:g}.")
        if not 0 <= self.close_gaps < math.inf:
            raise InputError(f"close_gaps must be a length, not {self.close_gaps:g}.")
        check_magnitude("close_gaps", self.close_gaps or 1.0)
        check_planes("symmetry", self.symmetry)
        names = [one.name for one in self.face]
        for name in names:
            if names.count(name) > 1:
                raise InputError(f"two faces are called '{name}'; give each a name of its own.")


def symmetry_name(axis: str) -> str:
    """Return the name of the cut across a coordinate."""
    return f"symmetry_{axis}"
