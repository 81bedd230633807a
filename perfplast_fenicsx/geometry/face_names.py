"""Assign names to free faces: automatic names, names from the file, and names from the user."""

import re
from collections.abc import Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from itertools import count

import gmsh
import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.errors import InputError, nearest
from perfplast_fenicsx.geometry.face_labels import hex_of, word_of
from perfplast_fenicsx.geometry.free_faces import (
    ALIKE,
    FaceSet,
    FreeFace,
    cylinder_of,
    round_of,
    shape_of,
)
from perfplast_fenicsx.geometry.joints import box
from perfplast_fenicsx.geometry.meshing_options import (
    AXES,
    MeshingOptions,
    NamedFace,
    symmetry_name,
)
from perfplast_fenicsx.geometry.part_names import plain_name
from perfplast_fenicsx.geometry.parts import Part


def usual_names(
    dim: int,
    parts: Sequence[Part],
    faces: Sequence[FreeFace],
    alike: Sequence[FaceSet],
    taken: set[str],
) -> tuple[list[str], list[FaceSet]]:
    """Return an automatic name for each face, and named sets of several faces.

    All faces of a body with the same label or colour, or on the same side, share a name. The side
    ``plate_z_high`` consists of all free faces in the plane z = const at the end of the body. A
    side has no name if some of its faces have labels or colours. A face without a name of its own
    is named by number, such as ``plate_face_7``. Other sets are named ``plate_plane_7`` or
    ``plate_cylinder_7``.

    Args:
        dim: Dimension of the faces.
        parts: The bodies.
        faces: Free faces.
        alike: Sets of similar faces, from :func:`free_faces.numbered_faces`.
        taken: Names that are already in use.
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
    """Return ``name`` with enough underscores to make it unused, and add the result to ``used``."""
    while name in used:
        name += "_"
    used.add(name)
    return name


def _marked(
    parts: Sequence[Part], faces: Sequence[FreeFace]
) -> Iterator[tuple[tuple[int, ...], list[str], str]]:
    """Yield faces of one body with a common label or colour, possible names, and a description."""
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
    """Yield the free faces on each side of each body, possible names, and a description."""
    around = [box(dim + 1, part.tags) for part in parts]
    together: dict[tuple[int, str], list[int]] = {}
    for k, face in enumerate(faces):
        if side := _side_of(dim, face.tag, around[face.body]):
            together.setdefault((face.body, side), []).append(k)
    for (body, side), members in together.items():
        if all(faces[k].colour is None and not faces[k].label for k in members):
            yield tuple(members), [f"{parts[body].name}_{side}"], "the whole side"


def _side_of(dim: int, tag: int, around: Floats) -> str:
    """Return the side of a body on which a flat face lies, such as "z_high"; "" for other faces."""
    low, high = box(dim, [tag])
    # bounding boxes contain the tolerances of edges, which are larger after gaps are closed
    wider = 3 * gmsh.option.getNumber("Geometry.ToleranceBoolean")
    none = ALIKE * float(np.linalg.norm(around[1] - around[0])) + wider
    if shape_of(dim, tag) in ("flat", "straight"):
        for axis in np.flatnonzero((high - low < none)[: dim + 1])[:1]:
            for side, end in zip(("low", "high"), around[:, axis], strict=True):
                if abs(low[axis] - end) < 2 * none:
                    return f"{AXES[axis]}_{side}"
    return ""


CLOSE = 1e-4
"""Distance up to which a face counts as lying at a given place, relative to the bodies' size."""


def face_names(
    dim: int,
    parts: Sequence[Part],
    faces: Sequence[FreeFace],
    alike: Sequence[FaceSet],
    options: MeshingOptions,
    of_file: Mapping[str, AbstractSet[int]],
) -> tuple[list[str], list[FaceSet]]:
    """Return the automatic name of each free face, and all named sets of faces.

    Args:
        dim: Dimension of the faces.
        parts: The bodies.
        faces: Free faces.
        alike: Sets of similar faces.
        options: Options, which contain the names from the user.
        of_file: Tags of faces by names in the geometry file, including faces at joints.

    Raises:
        InputError: If a name of the user selects no face, or if a name is given twice.
    """
    planes = {symmetry_name(axis): {axis: value} for axis, value in options.symmetry.items()}
    wanted = [NamedFace(name, plane=plane) for name, plane in planes.items()] + options.face
    for one in wanted:
        if one.name in of_file:
            raise InputError(
                f"the face '{one.name}': the geometry file already has a physical group with this "
                "name; give another name."
            )
    bodies = [part.name for part in parts]
    taken = {one.name for one in wanted} | {*of_file}
    # names of the sides of joints
    taken |= {f"{body}_{name}" for name in of_file for body in bodies}
    names, usual = usual_names(dim, parts, faces, alike, taken)
    given = list[FaceSet]()
    for name, tags in of_file.items():
        members = tuple(k for k, face in enumerate(faces) if face.tag in tags)
        if members:
            given.append(FaceSet(0, name, members, "physical group of the file"))
    choice = _Choice(dim, parts, faces, names, [*usual, *given])
    for one in wanted:
        chosen = FaceSet(0, one.name, tuple(sorted(choice.of(one))), _in_words(one))
        choice.sets.append(chosen)
        given.append(chosen)
    return names, [*usual, *given]


class _Choice:
    """Finds the faces that a :class:`NamedFace` selects."""

    def __init__(
        self,
        dim: int,
        parts: Sequence[Part],
        faces: Sequence[FreeFace],
        names: Sequence[str],
        sets: list[FaceSet],
    ) -> None:
        self.dim, self.faces, self.names, self.sets = dim, faces, names, sets
        self.bodies = [part.name for part in parts]
        around = np.array([box(dim + 1, part.tags) for part in parts])
        size = float(np.linalg.norm(around[:, 1].max(axis=0) - around[:, 0].min(axis=0)))
        self.close = CLOSE * size

    def of(self, wanted: NamedFace) -> list[int]:
        """Return the indices of the selected faces in the list of free faces.

        Raises:
            InputError: If no face is selected, or several faces where only one is allowed.
        """
        if wanted.body and wanted.body not in self.bodies:
            raise InputError(
                f"the face '{wanted.name}' belongs to '{wanted.body}', but there is no such body;"
                f" {nearest(wanted.body, self.bodies)}"
            )
        own = [k for k, f in enumerate(self.faces) if wanted.body in ("", self.bodies[f.body])]
        if wanted.number is not None:
            return self._of_number(wanted, own)
        if wanted.faces is not None:
            return self._of_names(wanted, own)
        if wanted.colour is not None or wanted.label is not None:
            return self._of_mark(wanted, own)
        misses = np.array([_miss(self.dim, self.faces[k].tag, wanted) for k in own])
        near = np.flatnonzero(misses < self.close)
        if not near.size or (wanted.point is not None and near.size > 1):
            raise InputError(self._no_face(own, misses, wanted))
        found = [own[k] for k in near]
        if wanted.angle is None:
            return found
        return _reached(self.dim, self.faces, found[0], wanted.angle)

    def _of_number(self, wanted: NamedFace, own: Sequence[int]) -> list[int]:
        found = [k for k in own if self.faces[k].number == wanted.number]
        for one in self.sets:
            if one.number == wanted.number and wanted.number:
                found += [k for k in one.faces if k in own]
        if not found:
            raise InputError(
                f"the face '{wanted.name}' has number {wanted.number}, but no free face or set of "
                f"faces has this number; perfplast mesh lists all {len(self.faces)} faces."
            )
        return found

    def _of_names(self, wanted: NamedFace, own: Sequence[int]) -> list[int]:
        known: dict[str, tuple[int, ...]] = {name: (k,) for k, name in enumerate(self.names)}
        known |= {one.name: one.faces for one in self.sets}
        found: set[int] = set()
        for name in wanted.faces or ():
            if name not in known:
                raise InputError(
                    f"the face '{wanted.name}' contains '{name}', but there is no such free face; "
                    f"{nearest(name, known)}"
                )
            found |= {*known[name]} & {*own}
        if not found:
            raise InputError(
                f"the face '{wanted.name}': no face listed for it belongs to '{wanted.body}'; give "
                "another body, or remove body."
            )
        return list(found)

    def _of_mark(self, wanted: NamedFace, own: Sequence[int]) -> list[int]:
        """Return the indices of the faces in ``own`` that have the wanted label or colour."""
        if wanted.label is not None:
            what, value = "label", wanted.label
            names: dict[int, tuple[str, ...]] = {
                k: (self.faces[k].label,) for k in own if self.faces[k].label
            }
        else:
            what, value = "colour", str(wanted.colour).lower()
            colours = {k: self.faces[k].colour for k in own}
            names = {k: (word_of(c), hex_of(c)) for k, c in colours.items() if c is not None}
        found = [k for k, some in names.items() if value in some]
        if not found:
            there = ", ".join(sorted({" ".join(some) for some in names.values()}))
            remedy = f"the {what}s are {there}" if there else f"no free face has a {what}"
            raise InputError(
                f"the face '{wanted.name}': no free face has the {what} '{value}'; {remedy}."
            )
        return found

    def _no_face(self, own: Sequence[int], misses: Floats, wanted: NamedFace) -> str:
        kinds = ("plane", "point", "radius", "box")
        (kind,) = [kind for kind in kinds if getattr(wanted, kind) is not None]
        where = _where(wanted)
        whose = f" of '{wanted.body}'" if wanted.body else ""
        if (misses < self.close).any():
            near = np.flatnonzero(misses < self.close)
            several = " and ".join(f"'{self.names[own[k]]}'" for k in near)
            return (
                f"the face '{wanted.name}': {several} lie {where}; give a point inside one "
                "face, or the body."
            )
        if not np.isfinite(misses).any():
            return (
                f"the face '{wanted.name}': no free face{whose} lies {where}; give another {kind}."
            )
        k = int(np.argmin(misses))
        return (
            f"the face '{wanted.name}': no free face{whose} lies {where}; the nearest is"
            f" '{self.names[own[k]]}', {misses[k]:.4g} away."
        )


def _where(wanted: NamedFace) -> str:
    """Return the place at which ``wanted`` selects faces, in words."""
    if wanted.plane is not None:
        ((axis, at),) = wanted.plane.items()
        return f"in the plane {axis} = {at:g}"
    if wanted.box is not None:
        return f"within the box {wanted.box}"
    if wanted.point is not None:
        return f"at ({', '.join(f'{x:g}' for x in wanted.point)})"
    about = f" about {tuple(wanted.about)}" if wanted.about else ""
    return f"with the radius {wanted.radius:g}{about}"


def _in_words(wanted: NamedFace) -> str:
    """Return a description of how ``wanted`` selects faces."""
    if wanted.faces is not None:
        return f"of {', '.join(wanted.faces)}"
    for what in ("number", "colour", "label"):
        if (value := getattr(wanted, what)) is not None:
            return f"{what} {value}"
    angle = f", and across angles below {wanted.angle:g}°" if wanted.angle is not None else ""
    return _where(wanted) + angle


def _miss(dim: int, tag: int, wanted: NamedFace) -> float:
    """Return the distance of a face from the wanted place; infinite if its shape does not fit."""
    if wanted.plane is not None:
        ((axis, value),) = wanted.plane.items()
        if shape_of(dim, tag) not in ("flat", "straight"):
            return np.inf
        low, high = box(dim, [tag])
        along = AXES.index(axis)
        if high[along] - low[along] > CLOSE * (high - low).max():
            return np.inf
        return float(max(abs(low[along] - value), abs(high[along] - value)))
    if wanted.box is not None:
        ends = np.array([wanted.box[0], wanted.box[1]])
        axes = ends.shape[1]
        low, high = box(dim, [tag])[:, :axes]
        return float(max((ends.min(axis=0) - low).max(), (high - ends.max(axis=0)).max(), 0.0))
    if wanted.point is not None:
        return _distance(dim, tag, _in_space(wanted.point))
    on = cylinder_of(dim, tag)
    if on is None or wanted.radius is None:
        return np.inf
    miss = abs(abs(on.radius) - wanted.radius)
    if wanted.about is not None:
        beside = _in_space(wanted.about) - on.centre
        miss = max(miss, float(np.linalg.norm(beside - (beside @ on.axis) * on.axis)))
    return miss


def _in_space(point: Sequence[float]) -> Floats:
    return np.array([*point, 0.0][:3])


def _distance(dim: int, tag: int, point: Floats) -> float:
    """Return the distance of a point from a face; infinite if the point projects outside it."""
    foot, _ = gmsh.model.getClosestPoint(dim, tag, point)
    return float(np.linalg.norm(point - foot)) if gmsh.model.isInside(dim, tag, foot) else np.inf


def _reached(dim: int, faces: Sequence[FreeFace], first: int, angle: float) -> list[int]:
    """Return the faces that edges with angles below ``angle`` connect to the face ``first``.

    Args:
        dim: Dimension of the faces.
        faces: Free faces.
        first: Index of the first face.
        angle: Limit of the angle between the tangents of both faces at an edge (degrees).
    """
    body = faces[first].body
    place = {face.tag: k for k, face in enumerate(faces) if face.body == body}
    found, left = {first}, [first]
    while left:
        one = left.pop()
        edges = gmsh.model.getAdjacencies(dim, faces[one].tag)[1]
        for edge in map(int, edges):
            for tag in map(int, gmsh.model.getAdjacencies(dim - 1, edge)[0]):
                other = place.get(tag)
                if other is None or other in found:
                    continue
                if _angle(dim, edge, faces[one].tag, tag) < angle:
                    found.add(other)
                    left.append(other)
    return sorted(found)


def _angle(dim: int, edge: int, one: int, other: int) -> float:
    """Return the angle between the tangents of two faces at the middle of an edge (degrees)."""
    at: Floats = np.zeros(0)
    if dim == 2:
        low, high = gmsh.model.getParametrizationBounds(1, edge)
        at = np.array([(low[0] + high[0]) / 2])
    directions = []
    for tag in (one, other):
        if dim == 2:
            places = gmsh.model.reparametrizeOnSurface(1, edge, at, tag)
            along = np.array(gmsh.model.getNormal(tag, places))
        else:
            point = gmsh.model.getValue(0, edge, [])
            along = np.array(gmsh.model.getDerivative(1, tag, _parameter(tag, np.array(point))))
        directions.append(along / np.linalg.norm(along))
    cosine = abs(float(directions[0] @ directions[1]))
    return float(np.degrees(np.arccos(min(1.0, cosine))))


def _parameter(curve: int, point: Floats) -> Floats:
    """Return the parameter of the end of a curve that is closer to a point."""
    low, high = map(np.asarray, gmsh.model.getParametrizationBounds(1, curve))
    ends = [np.array(gmsh.model.getValue(1, curve, at)) for at in (low, high)]
    return low if np.linalg.norm(ends[0] - point) < np.linalg.norm(ends[1] - point) else high
