"""Free faces of bodies, put together by label, colour, plane or cylinder."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import gmsh
import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.geometry.face_choice import AXES
from perfplast_fenicsx.geometry.face_colours import Colour, Mark, hex_of, word_of
from perfplast_fenicsx.geometry.joints import box
from perfplast_fenicsx.geometry.part_names import plain_name
from perfplast_fenicsx.geometry.parts import Part
from perfplast_fenicsx.geometry.surface_kind import kind_of

ALIKE = 1e-6
"""Normals, radii and places that differ by less, relative to the size of the body, are the same."""

Key = tuple[object, ...]


@dataclass(frozen=True)
class FaceGroup:
    """What one body has free of one label or colour, in one plane or on one cylinder, or one face.

    Attributes:
        number: As in the picture.
        body: Its number.
        tags: The faces.
        colour: Of their own in the file; None for that of most of the body.
        label: Of their own in the file; empty where they have none.
    """

    number: int
    body: int
    tags: tuple[int, ...]
    colour: Colour | None = None
    label: str = ""


@dataclass(frozen=True)
class Cylinder:
    """The cylinder that a face lies on; in the plane, the circle of a curve.

    Attributes:
        radius: Negative for the face of a hole, or of a shaft, as its normal points.
        axis: Direction, its largest component positive.
        centre: The point of the axis next to the origin.
    """

    radius: float
    axis: Floats
    centre: Floats


def shape_of(dim: int, tag: int) -> str:
    """The shape of a face, such as "flat"; of a curve, such as "straight"."""
    kind = kind_of(dim, tag)
    if kind == "Cylinder":
        return "cylindrical"
    # What gmsh's kinds of faces are called, where not as by gmsh.
    words = {"Plane": "flat", "Line": "straight", "Circle": "round", "Ellipse": "round"}
    return words.get(kind, kind.removesuffix(" surface").lower())


def put_together(
    dim: int, faces: Mapping[int, int], size: float, marks: Mapping[int, Mark]
) -> list[FaceGroup]:
    """Free faces by body, label, colour, plane and cylinder, numbered from 1.

    Args:
        dim: Of the faces.
        faces: The body of each.
        size: Of the bodies.
        marks: Of the faces that have a label or a colour of their own.
    """
    groups: dict[Key, list[int]] = {}
    for face, body in faces.items():
        mark = marks.get(face)
        alike = _lie_on(dim, face, size) if mark is None else ("mark", mark.label, mark.colour)
        groups.setdefault((body, *alike), []).append(face)
    together = sorted(groups.values(), key=lambda tags: faces[tags[0]])
    marked = [marks.get(tags[0]) for tags in together]
    return [
        FaceGroup(k, faces[tags[0]], tuple(tags), mark.colour, mark.label)
        if mark is not None
        else FaceGroup(k, faces[tags[0]], tuple(tags))
        for k, (tags, mark) in enumerate(zip(together, marked, strict=True), start=1)
    ]


def usual_names(
    dim: int, parts: Sequence[Part], groups: Sequence[FaceGroup], taken: set[str]
) -> list[str]:
    """A name for each group: by label, colour, the end of the body at which it lies, or number.

    Args:
        dim: Of the faces.
        parts: The bodies.
        groups: Of free faces.
        taken: Names that others have.
    """
    used, around = set(taken), [box(dim + 1, part.tags) for part in parts]
    labelled: dict[tuple[int, str], str] = {}  # groups of one label and body share a name
    bodies, names = [part.name for part in parts], list[str]()
    for group in groups:
        body = parts[group.body].name
        known = (group.body, group.label)
        if known in labelled:
            names.append(labelled[known])
            continue
        if name_part := plain_name(group.label):
            name: str | None = f"{body}_{name_part}"
            name = None if name in bodies or re.search(r"joint_\d+$", name_part) else name
        elif group.colour is not None:
            name = f"{body}_{word_of(group.colour)}"
            name = f"{name}_{hex_of(group.colour)[1:]}" if name in used else name
        else:
            name = _by_end(body, dim, group.tags, around[group.body])
        if name is None or name in used:
            name = f"{body}_face_{group.number}"
        while name in used:
            name += "_"
        used.add(name)
        names.append(name)
        if group.label:
            labelled[known] = name
    return names


def cylinder_of(dim: int, tag: int) -> Cylinder | None:
    """The cylinder or circle that a face or curve lies on, if any."""
    low, high = map(np.asarray, gmsh.model.getParametrizationBounds(dim, tag))
    if dim == 1 and gmsh.model.getType(dim, tag) in ("Circle", "Ellipse"):
        places = np.concatenate([low + share * (high - low) for share in (0.0, 0.2, 0.5, 0.7)])
        first, *others = np.reshape(gmsh.model.getValue(1, tag, places), (4, 3))
        chords = np.array(others) - first
        squares = np.einsum("ij,ij->i", chords, chords) / 2
        along = np.linalg.lstsq(chords, squares, rcond=None)[0]
        if np.abs(chords @ along - squares).max() > ALIKE * squares.max():
            return None  # an ellipse
        return Cylinder(float(np.linalg.norm(along)), np.array([0.0, 0.0, 1.0]), first + along)
    if dim != 2 or kind_of(dim, tag) != "Cylinder":
        return None
    middle = (low + high) / 2
    large, small, along_large, along_small = gmsh.model.getPrincipalCurvatures(tag, middle)
    straight = abs(large[0]) < abs(small[0])
    axis, curvature = (along_large, small[0]) if straight else (along_small, large[0])
    axis = axis * np.sign(axis[np.argmax(np.abs(axis))])
    point = np.array(gmsh.model.getValue(dim, tag, middle))
    centre = point + np.array(gmsh.model.getNormal(tag, middle)) / curvature
    return Cylinder(1 / curvature, axis, centre - (centre @ axis) * axis)


def round_of(dim: int, tag: int) -> str:
    """Radius and axis of the cylinder that a face lies on, in words; empty of other faces."""
    on = cylinder_of(dim, tag)
    if on is None:
        return ""
    radius = f"R {abs(on.radius):.5g}"
    if dim == 1:
        return radius
    along = np.flatnonzero(np.abs(on.axis) > ALIKE)
    axis = np.round(on.axis, 3) + 0.0
    words = AXES[along[0]] if len(along) == 1 else f"({', '.join(f'{a:g}' for a in axis)})"
    return f"{radius}, along {words}"


def _by_end(body: str, dim: int, tags: Sequence[int], around: Floats) -> str | None:
    low, high = box(dim, tags)
    # boxes are wider by the tolerances of edges, which gaps that were closed have left
    wider = 3 * gmsh.option.getNumber("Geometry.ToleranceBoolean")
    none = ALIKE * float(np.linalg.norm(around[1] - around[0])) + wider
    if shape_of(dim, tags[0]) in ("flat", "straight"):
        for axis in np.flatnonzero(high - low < none)[: 1 if dim == 2 else None]:
            for side, end in zip(("low", "high"), around[:, axis], strict=True):
                if abs(low[axis] - end) < 2 * none and around[1, axis] > around[0, axis]:
                    return f"{body}_{AXES[axis]}_{side}"
    return None


def _lie_on(dim: int, tag: int, size: float) -> Key:
    """What is the same for faces in one plane, and for those on one cylinder."""
    kind = kind_of(dim, tag)
    if dim == 2 and kind == "Plane":
        middle = np.mean(gmsh.model.getParametrizationBounds(dim, tag), axis=0)
        normal = np.array(gmsh.model.getNormal(tag, middle))
        place = float(np.array(gmsh.model.getValue(dim, tag, middle)) @ normal)
        return (kind, *_rounded(normal), *_rounded(np.array([place / size])))
    if dim == 2 and (on := cylinder_of(dim, tag)) is not None:
        return (kind, *_rounded(on.axis), *_rounded(np.array([on.radius, *on.centre]) / size))
    return (kind, tag)


def _rounded(values: Floats) -> tuple[int, ...]:
    return tuple(int(n) for n in np.rint(values / (10 * ALIKE)))
