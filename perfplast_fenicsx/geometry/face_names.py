"""The names of free faces: those that a user gives, those of planes of symmetry, and the rest."""

from collections.abc import Sequence

import gmsh
import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.errors import InputError, nearest
from perfplast_fenicsx.geometry.face_choice import AXES, NamedFace
from perfplast_fenicsx.geometry.face_colours import hex_of, word_of
from perfplast_fenicsx.geometry.free_faces import FaceGroup, cylinder_of, shape_of, usual_names
from perfplast_fenicsx.geometry.joints import box
from perfplast_fenicsx.geometry.meshing_options import MeshingOptions, symmetry_name
from perfplast_fenicsx.geometry.parts import Part

CLOSE = 1e-4
"""Faces that are closer to a place than this share of the bodies' size lie there."""


def face_names(
    dim: int, parts: Sequence[Part], groups: Sequence[FaceGroup], options: MeshingOptions
) -> list[str]:
    """A name for each group of free faces; groups may share one that a user has given.

    Args:
        dim: Of the faces.
        parts: The bodies.
        groups: Of free faces.
        options: With the names that are wanted.

    Raises:
        InputError: If no face is where one is wanted, or one is to have two names.
    """
    own = {symmetry_name(axis): {axis: value} for axis, value in options.symmetry.items()}
    wanted = [NamedFace(name, plane=plane) for name, plane in own.items()] + options.face
    names = usual_names(dim, parts, groups, {one.name for one in wanted})
    given: dict[int, str] = {}
    for one in wanted:
        for k in _chosen(dim, parts, groups, names, one):
            if k in given:
                raise InputError(
                    f"'{names[k]}' is to be called both '{given[k]}' and '{one.name}'; a face has"
                    " one name only."
                )
            given[k] = one.name
    return [given.get(k, name) for k, name in enumerate(names)]


def _chosen(
    dim: int,
    parts: Sequence[Part],
    groups: Sequence[FaceGroup],
    names: Sequence[str],
    wanted: NamedFace,
) -> list[int]:
    """The groups that a name is for."""
    bodies = [part.name for part in parts]
    if wanted.body and wanted.body not in bodies:
        raise InputError(
            f"the face '{wanted.name}' is to be of '{wanted.body}', but there is no such body;"
            f" {nearest(wanted.body, bodies)}"
        )
    around = np.array([box(dim + 1, part.tags) for part in parts])
    size = float(np.linalg.norm(around[:, 1].max(axis=0) - around[:, 0].min(axis=0)))
    own = [k for k, g in enumerate(groups) if wanted.body in ("", bodies[g.body])]
    if wanted.number is not None:
        found = [k for k in own if groups[k].number == wanted.number]
        if not found:
            raise InputError(
                f"the face '{wanted.name}' is to be number {wanted.number}, but there are"
                f" {len(groups)} free faces; perfplast mesh lists them."
            )
        return found
    if wanted.colour is not None:
        return _of_colour(wanted, groups, own)
    misses = np.array([_miss(dim, groups[k], wanted) for k in own])
    near = np.flatnonzero(misses < CLOSE * size)
    if not near.size or (wanted.point is not None and near.size > 1):
        raise InputError(_no_face(names, own, misses, wanted, CLOSE * size))
    return [own[k] for k in near]


def _of_colour(wanted: NamedFace, groups: Sequence[FaceGroup], own: Sequence[int]) -> list[int]:
    """The groups of a colour, by its word or its numbers."""
    colours = {k: groups[k].colour for k in own}
    names = {k: (word_of(c), hex_of(c)) for k, c in colours.items() if c is not None}
    found = [k for k, both in names.items() if str(wanted.colour).lower() in both]
    if not found:
        there = ", ".join(sorted({f"{word} {number}" for word, number in names.values()}))
        raise InputError(
            f"the face '{wanted.name}': no free face has the colour '{wanted.colour}' of its own;"
            f" there are {there or 'no coloured ones'}."
        )
    return found


def _no_face(
    names: Sequence[str], own: Sequence[int], misses: Floats, wanted: NamedFace, close: float
) -> str:
    place = {"plane": wanted.plane, "point": wanted.point, "radius": wanted.radius}
    ((kind, value),) = [(kind, value) for kind, value in place.items() if value is not None]
    if isinstance(value, dict):
        ((axis, at),) = value.items()
        where = f"in the plane {axis} = {at:g}"
    elif isinstance(value, list):
        where = f"at ({', '.join(f'{x:g}' for x in value)})"
    else:
        where = f"with the radius {value:g}"
        where += f" about {tuple(wanted.about)}" if wanted.about else ""
    whose = f" of '{wanted.body}'" if wanted.body else ""
    if (misses < close).any():
        several = " and ".join(f"'{names[own[k]]}'" for k in np.flatnonzero(misses < close))
        return (
            f"the face '{wanted.name}': {several} lie {where}; give a point within one face, or the"
            " body."
        )
    if not np.isfinite(misses).any():
        return f"the face '{wanted.name}': no free face{whose} lies {where}; give another {kind}."
    k = int(np.argmin(misses))
    return (
        f"the face '{wanted.name}': no free face{whose} lies {where}; the nearest is"
        f" '{names[own[k]]}', {misses[k]:.4g} away."
    )


def _miss(dim: int, group: FaceGroup, wanted: NamedFace) -> float:
    """How far faces are from where a name is for; infinite where their shape is another one."""
    if wanted.plane is not None:
        ((axis, value),) = wanted.plane.items()
        if shape_of(dim, group.tags[0]) not in ("flat", "straight"):
            return np.inf
        low, high = box(dim, group.tags)
        along = AXES.index(axis)
        if high[along] - low[along] > CLOSE * (high - low).max():
            return np.inf
        return float(max(abs(low[along] - value), abs(high[along] - value)))
    if wanted.point is not None:
        return min(_distance(dim, tag, _in_space(wanted.point)) for tag in group.tags)
    on = cylinder_of(dim, group.tags[0])
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
    """From a point to a face; infinite where the face is not opposite to it."""
    foot, _ = gmsh.model.getClosestPoint(dim, tag, point)
    return float(np.linalg.norm(point - foot)) if gmsh.model.isInside(dim, tag, foot) else np.inf
