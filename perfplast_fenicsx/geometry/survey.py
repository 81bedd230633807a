"""Store the survey of a geometry: bodies, joints, near misses, and free faces."""

from collections.abc import Sequence
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Body:
    """A solid; in the plane a face.

    Attributes:
        name: Its physical name in the mesh.
        label: Its name in the file, with those of its assemblies.
        volume: Volume of its mesh (in the plane its area).
        low: Smallest coordinates.
        high: Largest coordinates.
        cells: Number of elements.
        worst: Quality of the worst element, 1 for an equilateral one, 0 for a flat one.
        cad: Its volume (in the plane its area) in the file; None if it is unknown.
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
    """A joint where two bodies touch.

    Attributes:
        bodies: Their names.
        surfaces: The names of both sides in the mesh.
        area: Area of the contact (in the plane its length).
        shapes: Shapes of its faces, such as "flat" or "cylindrical".
        shared: Whether the bodies share these faces in the drawing, as layers of one ground do;
            otherwise they touch as separate solids.
        cad: The area in the file; None where that is not known.
    """

    bodies: tuple[str, str]
    surfaces: tuple[str, str]
    area: float
    shapes: tuple[str, ...]
    shared: bool = False
    cad: float | None = None


@dataclass(frozen=True)
class Face:
    """A free face of the drawing; in the plane a curve.

    Attributes:
        number: Number in the picture.
        name: Its own name in the mesh.
        body: Its body.
        shape: Such as "flat".
        area: Area of its mesh.
        centre: Centroid of its mesh.
        cad: Its area in the file; None if it is unknown.
        round_of: Radius and axis direction of a cylinder, such as "R 5, along z"; empty for other
            faces.
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
    """Free faces with a common name in addition to their own names.

    Attributes:
        number: Number in the list; 0 if the file or the user gives the name.
        name: Name in the mesh.
        faces: Numbers of the faces; empty for a physical group where bodies touch.
        why: Their common property, in words.
        area: Area of their mesh.
        cad: Their area in the file; None if it is unknown.
    """

    number: int
    name: str
    faces: tuple[int, ...]
    why: str
    area: float
    cad: float | None = None


def listed(numbers: Sequence[int]) -> str:
    """Return the number of faces and their numbers, such as "3: 4-5, 9"."""
    runs = list[list[int]]()
    for number in sorted(numbers):
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    words = [f"{run[0]}-{run[-1]}" if len(run) > 1 else f"{run[0]}" for run in runs]
    most = 8  # largest number of listed ranges
    more = [f"and {len(words) - most} more"] if len(words) > most else []
    return f"{len(numbers)}: {', '.join(words[:most] + more)}" if words else "-"


@dataclass(frozen=True)
class Near:
    """Two bodies that nearly touch, or touch without a common face.

    Attributes:
        bodies: Their names.
        gap: The smallest distance between them, 0 if they share an edge or a point.
    """

    bodies: tuple[str, str]
    gap: float


@dataclass(frozen=True)
class Survey:
    """The survey of a meshed geometry.

    Attributes:
        dim: 3 for solids, 2 for a plane model.
        degree: Degree of the elements' geometry.
        nodes: Number of nodes of the mesh, counting both sides of joints.
        bodies: At least one.
        joints: Joints of bodies that touch.
        near: Pairs of bodies that nearly touch.
        faces: Free faces, sorted by body and number.
        sets: Sets of faces with common names.
        remarks: Remarks for the user, one sentence each.
        size: Requested largest edge length.
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
        """Return the area that the file gives each surface of the mesh, where it is known."""
        areas = {name: joint.cad for joint in self.joints for name in joint.surfaces}
        areas |= {one.name: one.cad for one in self.faces}
        areas |= {one.name: one.cad for one in self.sets}
        return {name: area for name, area in areas.items() if area is not None}

    def faces_of(self, name: str) -> list[Face]:
        """Return the free faces with a name, their own or a common one."""
        numbers = {number for one in self.sets if one.name == name for number in one.faces}
        return [face for face in self.faces if face.name == name or face.number in numbers]
