"""The survey of a geometry: bodies, where they touch or nearly touch, and their free faces."""

from collections.abc import Sequence
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Body:
    """A solid; in the plane, a face.

    Attributes:
        name: Its physical name in the mesh.
        label: Its name in the file, with those of the assemblies it is part of.
        volume: Volume of its mesh (in the plane, the area).
        low: Smallest coordinates.
        high: Largest coordinates.
        cells: Elements.
        worst: Quality of the worst one, 1 for an equilateral one, 0 for a flat one.
        cad: Its volume (in the plane, the area) in the file; None where that is not known.
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
    """Where two bodies touch.

    Attributes:
        bodies: Their names.
        surfaces: The names of both sides in the mesh.
        area: Area of the contact (in the plane, the length).
        shapes: Shapes of the faces in it, such as "flat" or "cylindrical".
        shared: Whether the bodies share these faces in the drawing, as layers of one ground do;
            else they touch as solids of their own.
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
    """A free face of the drawing; in the plane, a curve.

    Attributes:
        number: As in the picture.
        name: Its own name in the mesh.
        body: Whose it is.
        shape: Such as "flat".
        area: Area of its mesh.
        centre: Its centroid, as the mesh has it.
        cad: Its area in the file; None where that is not known.
        round_of: Of a cylinder, its radius and the direction of its axis, such as "R 5, along z";
            empty for others.
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
    """Free faces with a name together, which each of them has besides its own.

    Attributes:
        number: As in the list; 0 where the file or a user gives the name.
        name: In the mesh.
        faces: Numbers of the faces; none of a physical group where bodies touch.
        why: Their common property, in words.
        area: Area of their mesh.
        cad: Their area in the file; None where that is not known.
    """

    number: int
    name: str
    faces: tuple[int, ...]
    why: str
    area: float
    cad: float | None = None


def listed(numbers: Sequence[int]) -> str:
    """Return how many faces there are and their numbers, such as "3: 4-5, 9"."""
    runs = list[list[int]]()
    for number in sorted(numbers):
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    words = [f"{run[0]}-{run[-1]}" if len(run) > 1 else f"{run[0]}" for run in runs]
    most = 8  # so many stretches of numbers are listed
    more = [f"and {len(words) - most} more"] if len(words) > most else []
    return f"{len(numbers)}: {', '.join(words[:most] + more)}" if words else "-"


@dataclass(frozen=True)
class Near:
    """Two bodies that nearly touch, or touch without a common face.

    Attributes:
        bodies: Their names.
        gap: The smallest distance between them, 0 where they have an edge or a point in common.
    """

    bodies: tuple[str, str]
    gap: float


@dataclass(frozen=True)
class Survey:
    """The survey of a meshed geometry.

    Attributes:
        dim: 3 for solids, 2 for a plane model.
        degree: Degree of the elements' geometry.
        nodes: Nodes of the mesh, both sides of joints counted.
        bodies: At least one.
        joints: Joints of bodies that touch.
        near: Pairs of bodies that nearly touch.
        faces: Free faces, sorted by body and number.
        sets: Faces with names together.
        remarks: Remarks for the user, a sentence each.
        size: Largest edge length that was asked for.
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
        """Return the free faces that have a name, their own or one together with others."""
        numbers = {number for one in self.sets if one.name == name for number in one.faces}
        return [face for face in self.faces if face.name == name or face.number in numbers]
