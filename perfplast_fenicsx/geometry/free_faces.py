"""Free faces of bodies, put together where they lie in one plane or on one cylinder."""

from collections.abc import Mapping, Sequence

import gmsh
import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.geometry.joints import box

WORDS = {"Plane": "flat", "Line": "straight", "Circle": "round"}
"""What gmsh's kinds of faces are called, where not as by gmsh."""

ALIKE = 1e-6
"""Normals, radii and places that differ by less, relative to the size of the body, are the same."""

AXES = "xyz"

Key = tuple[object, ...]


def shape_of(dim: int, tag: int) -> str:
    """The shape of a face, such as "flat"; of a curve, such as "straight"."""
    kind = gmsh.model.getType(dim, tag)
    if kind == "Cylinder":
        return "cylindrical"
    return WORDS.get(kind, kind.removesuffix(" surface").lower())


def put_together(dim: int, faces: Mapping[int, int], size: float) -> list[tuple[int, list[int]]]:
    """Free faces by body, plane and cylinder.

    Args:
        dim: Of the faces.
        faces: The body of each.
        size: Of the bodies.

    Returns:
        The body and the faces of each group.
    """
    groups: dict[Key, list[int]] = {}
    for face, body in faces.items():
        groups.setdefault((body, *_lie_on(dim, face, size)), []).append(face)
    return [(faces[together[0]], together) for together in groups.values()]


def name_of(body: str, number: int, dim: int, tags: Sequence[int], around: Floats) -> str:
    """A name for free faces: by the end of the body at which they lie, or by their number.

    Args:
        body: Its name.
        number: Of the faces.
        dim: Of the faces.
        tags: The faces.
        around: Smallest and largest coordinates of the body, shape (2, 3).
    """
    low, high = box(dim, tags)
    length = float(np.linalg.norm(around[1] - around[0]))
    if shape_of(dim, tags[0]) in ("flat", "straight"):
        for axis in np.flatnonzero(high - low < ALIKE * length)[: 1 if dim == 2 else None]:
            for side, end in zip(("low", "high"), around[:, axis], strict=True):
                if abs(low[axis] - end) < 2 * ALIKE * length and around[1, axis] > around[0, axis]:
                    return f"{body}_{AXES[axis]}_{side}"
    return f"{body}_face_{number}"


def _lie_on(dim: int, tag: int, size: float) -> Key:
    """What is the same for faces in one plane, and for those on one cylinder."""
    kind = gmsh.model.getType(dim, tag)
    if dim == 2 and kind == "Plane":
        middle = np.mean(gmsh.model.getParametrizationBounds(dim, tag), axis=0)
        normal = np.array(gmsh.model.getNormal(tag, middle))
        place = float(np.array(gmsh.model.getValue(dim, tag, middle)) @ normal)
        return (kind, *_rounded(normal), *_rounded(np.array([place / size])))
    if dim == 2 and kind == "Cylinder":
        middle = np.mean(gmsh.model.getParametrizationBounds(dim, tag), axis=0)
        large, small, along_large, along_small = gmsh.model.getPrincipalCurvatures(tag, middle)
        straight = abs(large[0]) < abs(small[0])
        axis, curvature = (along_large, small[0]) if straight else (along_small, large[0])
        axis = axis * np.sign(axis[np.argmax(np.abs(axis))])
        point = np.array(gmsh.model.getValue(dim, tag, middle))
        centre = point + np.array(gmsh.model.getNormal(tag, middle)) / curvature
        centre -= (centre @ axis) * axis
        return (kind, *_rounded(axis), *_rounded(np.array([1 / curvature, *centre]) / size))
    return (kind, tag)


def _rounded(values: Floats) -> tuple[int, ...]:
    return tuple(int(n) for n in np.rint(values / (10 * ALIKE)))
