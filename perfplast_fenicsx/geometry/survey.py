"""Define the survey of a geometry: bodies, joints, near misses and free faces."""

from collections.abc import Sequence
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Body:
    """A body: a solid in 3D, or a face in the plane.

    Attributes:
        name: Name in the mesh.
        label: Name in the file, with the names of its assemblies.
        volume: Volume (in the plane area) of the body in the mesh.
        low: Smallest coordinates.
        high: Largest coordinates.
        cells: Number of elements.
        worst: Quality of the worst element: 1 for an equilateral element, 0 for a flat one.
        cad: Volume (in the plane area) in the file; None if it is unknown.
    """

    name: str
    label: str
    volume: float
    low: tuple[float, ...]
    high: tuple[float, ...]
    cells: int
    worst: float
    cad: float | None = None


@dataclass(frozen=True)
class Joint:
    """The place where two bodies touch.

    Attributes:
        bodies: Names of both bodies.
        surfaces: Names of both sides in the mesh.
        area: Area (in the plane length) at which the bodies touch, in the mesh.
        shapes: Shapes of the faces, such as "flat" or "cylindrical".
        shared: Whether the bodies share these faces in the drawing, like layers of ground;
            otherwise they touch as separate solids.
        cad: Area in the file; None if it is unknown.
        bore: Name of the body around a cylindrical joint; "" for joints of other shapes.
    """

    bodies: tuple[str, str]
    surfaces: tuple[str, str]
    area: float
    shapes: tuple[str, ...]
    shared: bool = False
    cad: float | None = None
    bore: str = ""


@dataclass(frozen=True)
class Face:
    """A free face of the drawing; in the plane a curve.

    Attributes:
        number: Number in the picture.
        name: Separate name of the face in the mesh.
        body: Name of the body.
        shape: Shape in words, such as "flat".
        area: Area (in the plane length) of the face in the mesh.
        centre: Centroid of the face in the mesh.
        cad: Area in the file; None if it is unknown.
        round_of: Kind, radius and direction of the axis for a cylinder, such as "bore, R 5, along
            z"; "" for other faces.
    """

    number: int
    name: str
    body: str
    shape: str
    area: float
    centre: tuple[float, ...]
    cad: float | None = None
    round_of: str = ""


@dataclass(frozen=True)
class NamedFaces:
    """Free faces that have a common name, in addition to their separate names.

    Attributes:
        number: Number of the set in the list; 0 if the file or the user gives the name.
        name: Name in the mesh.
        faces: Numbers of the faces; empty for a physical group at which bodies touch.
        why: Common property of the faces, in words.
        area: Area of all these faces in the mesh.
        cad: Area in the file; None if it is unknown.
    """

    number: int
    name: str
    faces: tuple[int, ...]
    why: str
    area: float
    cad: float | None = None


def listed(numbers: Sequence[int]) -> str:
    """Return the count of faces and their numbers as text, such as "3: 4-5, 9"."""
    runs = list[list[int]]()
    for number in sorted(numbers):
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    words = [f"{run[0]}-{run[-1]}" if len(run) > 1 else f"{run[0]}" for run in runs]
    most = 8  # largest number of ranges in the text
    more = [f"and {len(words) - most} more"] if len(words) > most else []
    return f"{len(numbers)}: {', '.join(words[:most] + more)}" if words else "-"


@dataclass(frozen=True)
class Near:
    """Two bodies that nearly touch, or that touch without a common face.

    Attributes:
        bodies: Names of both bodies.
        gap: Smallest distance between the bodies; 0 if they touch at an edge or a point.
    """

    bodies: tuple[str, str]
    gap: float


@dataclass(frozen=True)
class Survey:
    """The survey of a geometry after meshing.

    Attributes:
        dim: 3 for solids, 2 for a plane model.
        degree: Degree of the element geometry.
        nodes: Number of nodes in the mesh; nodes on joints are counted once for each side.
        bodies: The bodies, at least one.
        joints: Places where bodies touch.
        near: Pairs of bodies that nearly touch.
        faces: Free faces, sorted by body and number.
        sets: Sets of faces with common names.
        remarks: Remarks for the user, one sentence each.
        size: Largest edge length that was given to the mesher.
    """

    dim: int
    degree: int
    nodes: int
    bodies: list[Body]
    joints: list[Joint] = field(default_factory=list)
    near: list[Near] = field(default_factory=list)
    faces: list[Face] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
    size: float = 0.0
    sets: list[NamedFaces] = field(default_factory=list)

    def drawn_areas(self) -> dict[str, float]:
        """Return the areas of surfaces in the file by name, as far as they are known."""
        areas = {name: joint.cad for joint in self.joints for name in joint.surfaces}
        areas |= {one.name: one.cad for one in self.faces}
        areas |= {one.name: one.cad for one in self.sets}
        return {name: area for name, area in areas.items() if area is not None}

    def faces_of(self, name: str) -> list[Face]:
        """Return the free faces that have the name ``name``, separately or in a set."""
        numbers = {number for one in self.sets if one.name == name for number in one.faces}
        return [face for face in self.faces if face.name == name or face.number in numbers]
