"""Define the options for meshing a geometry file, and the faces that a user names."""

import math
from dataclasses import dataclass, field
from typing import Literal

from perfplast_fenicsx.errors import InputError, check_magnitude, nearest

AXES = "xyz"


@dataclass(frozen=True)
class NamedFace:
    """A name for free faces or curves. Exactly one key from ``plane`` to ``faces`` selects them.

    A face keeps its other names, and may have several names. The keys ``angle``, ``about`` and
    ``body`` refine the selection.

    Args:
        name: Name of the faces for supports, loads and contacts.
        plane: A coordinate and its value (length), such as {z = 40.0}; selects all flat faces in
            this plane.
        point: A point on a face (length; 2 or 3 numbers); selects the face that contains the point.
        angle: Angle (degrees, below 90), only with ``point``. The name then also selects faces
            across edges at which the angle between the tangents is smaller, such as the second half
            of a bore.
        radius: Radius of cylindrical faces (in the plane, of circular curves); selects all faces
            with this radius (length).
        about: A point on the axis of the cylinder (length; 2 or 3 numbers), only with ``radius``.
            It is required only to choose between several cylinders with this radius.
        number: Number of a face or set of faces in the list and the picture from
            ``perfplast mesh``.
        colour: Colour of faces in a STEP file that differs from the colour of most of the body.
            Give a word such as "red", or a code from the list of perfplast mesh, such as "#dd5228".
        label: Label of faces in a STEP file, as perfplast mesh lists it.
        box: Two opposite corners of a box (length; 2 or 3 numbers each); selects all faces inside
            the box.
        faces: Names of faces or sets of faces, from the list of perfplast mesh or from earlier
            [[geometry.face]] tables.
        body: Name of the body to which the faces must belong; the default is any body.
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
                    f"plane of '{self.name}' has {len(self.plane)} coordinates; give one "
                    "coordinate, such as {z = 40.0}, and select oblique faces by a point."
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
                f"box of '{self.name}' has {len(self.box)} corners; give two opposite corners, "
                "such as [[0, 0, 0], [10, 5, 2]]."
            )
        if self.faces is not None and not self.faces:
            raise InputError(f"faces of '{self.name}' is empty; give at least one name.")
        if self.angle is not None and (self.point is None or not 0 < self.angle < 90):
            raise InputError(
                f"angle = {self.angle:g} of '{self.name}' must lie between 0 and 90 degrees, and "
                "the key 'point' must be given with it; correct this, or remove the angle."
            )
        if self.radius is not None and not (self.radius > 0 and math.isfinite(self.radius)):
            raise InputError(
                f"radius = {self.radius:g} of '{self.name}' is not positive; give a "
                "positive length."
            )
        if self.about is not None and self.radius is None:
            raise InputError(
                f"the face '{self.name}' has the key 'about', but no key 'radius'; give radius, or "
                "remove about."
            )


def check_planes(what: str, planes: dict[str, float]) -> None:
    """Raise an error for a key that is not a coordinate, or a value that is not finite.

    Raises:
        InputError: If a key or value is not valid; the message has the key.
    """
    for axis, value in planes.items():
        if axis not in tuple(AXES):
            raise InputError(f"{what}: '{axis}' is not a coordinate; {nearest(axis, AXES)}")
        if not math.isfinite(value):
            raise InputError(f"{what}: {axis} = {value} is not finite; give a finite number.")


@dataclass(frozen=True)
class MeshingOptions:
    """Options for meshing a geometry file.

    Args:
        size: Largest edge length. The unit is the unit of length of the file, but for STEP files
            always mm. The default gives a few thousand elements in 3D, of about equal size.
        sizes: Largest edge length in single bodies, by names of bodies.
        curvature: Least number of elements around a full circle; 0 for no limit. The default is 10,
            or more if the areas of faces would otherwise have errors above 1 %.
        order: Degree of the geometry, 1 or 2; with 2, elements have quadratic edges and can be
            curved.
        meshed: "together" meshes touching bodies with matching nodes. "apart" meshes each body
            separately; contacts and ties then connect surfaces that do not match.
        shared: "glued" ties bodies that share faces in the drawing, such as layers of ground,
            unless the case has a contact or tie between them. "apart" does not tie them.
        symmetry: Planes of symmetry, such as {x = 0.0, y = 0.0}. The half with larger coordinates
            is kept, and the cut at x is the surface ``symmetry_x``.
        overlap: Largest allowed overlap of two bodies, relative to the volume of the smaller one.
            The body that comes later in the file gets the common volume. Larger overlaps are
            refused.
        close_gaps: Largest gap that is closed (length): two faces of bodies at a smaller distance
            become one face, at the position of one of them, so that the bodies touch. The value
            must be much smaller than thicknesses and edges.
        patience: Time limit for meshing (s).
        without: Names of bodies to leave out.
        face: Names that the user gives to faces.
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
                raise InputError(
                    f"{name} = {size:g} is not a positive {what}; give a positive number."
                )
            check_magnitude(name, size or 1.0)
        if self.curvature is not None and not 0 <= self.curvature <= 360:
            raise InputError(
                f"curvature = {self.curvature:g} is not between 0 and 360; give the least number "
                "of elements around a full circle."
            )
        if not 0 <= self.overlap < 1:
            raise InputError(
                f"overlap = {self.overlap:g} is not a valid fraction of the smaller body; give a "
                "number >= 0 and < 1."
            )
        if not 0 <= self.close_gaps < math.inf:
            raise InputError(
                f"close_gaps = {self.close_gaps:g} is not a valid length; give 0 or a "
                "positive number."
            )
        check_magnitude("close_gaps", self.close_gaps or 1.0)
        check_planes("symmetry", self.symmetry)
        names = [one.name for one in self.face]
        for name in names:
            if names.count(name) > 1:
                raise InputError(
                    f"two [[geometry.face]] tables have the name '{name}'; give them "
                    "different names."
                )


def symmetry_name(axis: str) -> str:
    """Return the name of the surface at a plane of symmetry."""
    return f"symmetry_{axis}"
