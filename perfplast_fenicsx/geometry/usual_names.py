"""Create default names of faces, for single faces and for groups with common properties."""

import re
from collections.abc import Iterator, Sequence
from itertools import count

import gmsh
import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.geometry.face_choice import AXES
from perfplast_fenicsx.geometry.face_colours import hex_of, word_of
from perfplast_fenicsx.geometry.free_faces import ALIKE, FaceSet, FreeFace, round_of, shape_of
from perfplast_fenicsx.geometry.joints import box
from perfplast_fenicsx.geometry.part_names import plain_name
from perfplast_fenicsx.geometry.parts import Part


def usual_names(
    dim: int,
    parts: Sequence[Part],
    faces: Sequence[FreeFace],
    alike: Sequence[FaceSet],
    taken: set[str],
) -> tuple[list[str], list[FaceSet]]:
    """Return a name for each face, and the named sets of several faces.

    All faces of a body with one label or colour, or on one side, have a name: ``plate_z_high`` is
    the side, all free faces in the plane at which the body ends. A side on which some faces have
    labels or colours has no name. Faces without such a name are named by their number,
    ``plate_face_7``, and other sets ``plate_plane_7`` or ``plate_cylinder_7``.

    Args:
        dim: Dimension of the faces.
        parts: The bodies.
        faces: Free faces.
        alike: Sets of similar faces (:func:`free_faces.numbered_faces`).
        taken: Names that are already used.
    """
    used = set(taken)
    numbers = {one.faces: one.number for one in alike}
    after = count(max([0, *numbers.values(), *(face.number for face in faces)]) + 1)
    own: dict[int, str] = {}
    sets = list[FaceSet]()
    for members, names, why in (*_marked(parts, faces), *_sides(dim, parts, faces)):
        name = next((name for name in names if name not in used), None)
        if len(members) > 1:
            number = numbers.pop(members, 0) or next(after)
            if name is None:
                name = _free(f"{parts[faces[members[0]].body].name}_faces_{number}", used)
            sets.append(FaceSet(number, name, members, why))
        elif name is not None and members[0] not in own:
            own[members[0]] = name
        if name is not None:
            used.add(name)
    for one in alike:
        first = faces[one.faces[0]]
        if one.faces in numbers and one.why in ("plane", "cylinder"):
            name = _free(f"{parts[first.body].name}_{one.why}_{one.number}", used)
            place = round_of(dim, first.tag)
            why = f"in one {one.why}" if one.why == "plane" else f"on one {one.why}, {place}"
            sets.append(FaceSet(one.number, name, one.faces, why))
            used.add(name)
    names = [
        own.get(k) or _free(f"{parts[face.body].name}_face_{face.number}", used)
        for k, face in enumerate(faces)
    ]
    return names, sorted(sets, key=lambda one: one.number)


def _free(name: str, used: set[str]) -> str:
    """Return an unused name, and mark it as used."""
    while name in used:
        name += "_"
    used.add(name)
    return name


def _marked(
    parts: Sequence[Part], faces: Sequence[FreeFace]
) -> Iterator[tuple[tuple[int, ...], list[str], str]]:
    """Yield faces of one label or colour of each body, names for them, and the common property."""
    together: dict[tuple[object, ...], list[int]] = {}
    for k, face in enumerate(faces):
        if face.label:
            together.setdefault((face.body, face.label), []).append(k)
        elif face.colour is not None:
            together.setdefault((face.body, "", face.colour), []).append(k)
    bodies = [part.name for part in parts]
    for members in together.values():
        face = faces[members[0]]
        body = bodies[face.body]
        if face.label:
            plain = plain_name(face.label)
            allowed = plain and f"{body}_{plain}" not in bodies
            allowed = allowed and not re.search(r"joint_\d+$", plain)
            names, why = [f"{body}_{plain}"] if allowed else [], f"label '{face.label}'"
        else:
            assert face.colour is not None
            word, code = word_of(face.colour), hex_of(face.colour)
            names, why = [f"{body}_{word}", f"{body}_{word}_{code[1:]}"], f"{word} {code}"
        yield tuple(members), names, why


def _sides(
    dim: int, parts: Sequence[Part], faces: Sequence[FreeFace]
) -> Iterator[tuple[tuple[int, ...], list[str], str]]:
    """Yield the free faces of each side of each body, names for them, and the common property."""
    around = [box(dim + 1, part.tags) for part in parts]
    together: dict[tuple[int, str], list[int]] = {}
    for k, face in enumerate(faces):
        if side := _side_of(dim, face.tag, around[face.body]):
            together.setdefault((face.body, side), []).append(k)
    for (body, side), members in together.items():
        if all(faces[k].colour is None and not faces[k].label for k in members):
            yield tuple(members), [f"{parts[body].name}_{side}"], "the whole side"


def _side_of(dim: int, tag: int, around: Floats) -> str:
    """Return the side of a flat face at the end of its body, such as "z_high"; empty for others."""
    low, high = box(dim, [tag])
    # boxes are larger by the tolerances of edges, which closed gaps increase
    wider = 3 * gmsh.option.getNumber("Geometry.ToleranceBoolean")
    none = ALIKE * float(np.linalg.norm(around[1] - around[0])) + wider
    if shape_of(dim, tag) in ("flat", "straight"):
        for axis in np.flatnonzero((high - low < none)[: dim + 1])[:1]:
            for side, end in zip(("low", "high"), around[:, axis], strict=True):
                if abs(low[axis] - end) < 2 * none:
                    return f"{AXES[axis]}_{side}"
    return ""
