"""List the free faces of bodies, and group those in one plane or cylinder."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import count

import gmsh
import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.geometry.face_labels import Colour, Mark
from perfplast_fenicsx.geometry.joints import box
from perfplast_fenicsx.geometry.meshing_options import AXES


def kind_of(dim: int, tag: int) -> str:
    """Return gmsh's kind of a face or curve; "Plane", "Cylinder" or "Sphere" for splines."""
    kind = str(gmsh.model.getType(dim, tag))
    # Gmsh's kinds, in lower case, that may be planes, cylinders or spheres.
    untold = ("bspline surface", "bezier surface", "surface of revolution", "unknown")
    if dim != 2 or kind.lower() not in untold:
        return kind
    low, high = map(np.asarray, gmsh.model.getParametrizationBounds(2, tag))
    # Shares of each parameter at which curvatures are evaluated, because ends may be poles.
    samples = (0.2, 0.4, 0.6, 0.8)
    shares = np.stack(np.meshgrid(samples, samples), axis=-1).reshape(-1, 2)
    large, small, _, _ = gmsh.model.getPrincipalCurvatures(
        tag, (low + shares * (high - low)).ravel()
    )
    around = box(2, [tag])
    size = float(np.linalg.norm(around[1] - around[0]))
    both = np.sort(np.abs(np.column_stack([large, small])), axis=1) * size
    if not np.isfinite(both).all():
        return kind
    # Curvature that counts as zero, relative to the size of the face, and tolerance of equal ones.
    straight, same = 1e-5, 1e-4
    if both.max() < straight:
        return "Plane"
    alike = np.ptp(both, axis=0) < same * both.max()
    if not alike[1]:
        return kind
    if both[:, 0].max() < straight:
        return "Cylinder"
    if alike[0] and np.abs(both[:, 1] - both[:, 0]).max() < same * both.max():
        return "Sphere"
    return kind


ALIKE = 1e-6
"""Normals, radii and positions with a smaller difference, relative to the size of the body, are
equal."""


@dataclass(frozen=True)
class FreeFace:
    """A face of the drawing at which a body touches nothing; in the plane a curve.

    Attributes:
        number: Number in the list and the picture.
        body: Index of its body.
        tag: Tag of the face.
        colour: Its own colour in the file; None if it is that of most of the body.
        label: Its own label in the file; empty without one.
    """

    number: int
    body: int
    tag: int
    colour: Colour | None = None
    label: str = ""


@dataclass(frozen=True)
class FaceSet:
    """Several faces with a common name.

    Attributes:
        number: Number in the list; 0 if the file or a user defines the set.
        name: Name in the mesh; empty before it is named.
        faces: Indices in the list of free faces.
        why: Their common property, in words.
    """

    number: int
    name: str
    faces: tuple[int, ...]
    why: str


@dataclass(frozen=True)
class Cylinder:
    """The cylinder of a face; in the plane the circle of a curve.

    Attributes:
        radius: Radius; negative for the face of a hole, whose outward normal points to the axis.
        axis: Direction of the axis, with its largest component positive.
        centre: The point of the axis closest to the origin.
    """

    radius: float
    axis: Floats
    centre: Floats


def shape_of(dim: int, tag: int) -> str:
    """Return the shape of a face, such as "flat", or of a curve, such as "straight"."""
    kind = kind_of(dim, tag)
    if kind == "Cylinder":
        return "cylindrical"
    # Names of gmsh's kinds of faces, where they differ from gmsh's.
    words = {"Plane": "flat", "Line": "straight", "Circle": "round", "Ellipse": "round"}
    return words.get(kind, kind.removesuffix(" surface").lower())


def numbered_faces(
    dim: int, faces: Mapping[int, int], size: float, marks: Mapping[int, Mark]
) -> tuple[list[FreeFace], list[FaceSet]]:
    """Return the free faces with numbers, and sets of similar faces without names.

    Faces of one body are similar if they share label and colour, or without these lie in one plane
    or on one cylinder. Single faces and such sets are numbered first, from 1; the faces in the sets
    follow.

    Args:
        dim: Dimension of the faces.
        faces: The body of each face.
        size: Size of the bodies.
        marks: Marks of the faces with their own label or colour.

    Returns:
        The faces, sorted by body and number, and the sets.
    """
    tags = list(faces)
    kinds, labels = _alike(dim, tags, faces, size, marks)
    together: dict[int, list[int]] = {}
    for tag, label in zip(tags, labels, strict=True):
        together.setdefault(label, []).append(tag)
    groups = sorted(together.values(), key=lambda some: faces[some[0]])
    after, numbers = count(len(groups) + 1), dict[int, int]()
    for number, some in enumerate(groups, start=1):
        numbers.update({tag: number if len(some) == 1 else next(after) for tag in some})
    found = []
    for tag in sorted(tags, key=lambda tag: (faces[tag], numbers[tag])):
        mark = marks.get(tag)
        own = (mark.colour, mark.label) if mark is not None else (None, "")
        found.append(FreeFace(numbers[tag], faces[tag], tag, *own))
    place = {face.tag: k for k, face in enumerate(found)}
    sets = [
        FaceSet(number, "", tuple(sorted(place[tag] for tag in some)), kinds[some[0]])
        for number, some in enumerate(groups, start=1)
        if len(some) > 1
    ]
    return found, sets


def _alike(
    dim: int, tags: Sequence[int], faces: Mapping[int, int], size: float, marks: Mapping[int, Mark]
) -> tuple[dict[int, str], list[int]]:
    """Return the kind of surface of each face in a word, and a number, equal for similar faces."""
    kinds: dict[int, str] = {}
    families: dict[tuple[object, ...], list[int]] = {}
    places: dict[int, Floats] = {}
    for tag in tags:
        mark = marks.get(tag)
        if mark is not None:
            kinds[tag], places[tag] = "mark", np.zeros(1)
            families.setdefault((faces[tag], mark.label, mark.colour), []).append(tag)
        else:
            kinds[tag], places[tag] = _lie_on(dim, tag, size)
            alone = tag if kinds[tag] == "face" else 0
            families.setdefault((faces[tag], kinds[tag], alone), []).append(tag)
    labels: dict[int, int] = {}
    for family in families.values():
        same = 10 * ALIKE
        points = np.array([places[tag] for tag in family])
        pairs = cKDTree(points).query_pairs(same, p=np.inf, output_type="ndarray")
        graph = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(family),) * 2)
        parts = connected_components(graph, directed=False)[1]
        first = len(labels)
        labels.update({tag: first + int(part) for tag, part in zip(family, parts, strict=True)})
    return kinds, [labels[tag] for tag in tags]


def _lie_on(dim: int, tag: int, size: float) -> tuple[str, Floats]:
    """Return "plane", "cylinder" or "face", and numbers that identify the plane or cylinder."""
    if dim == 2 and kind_of(dim, tag) == "Plane":
        middle = np.mean(gmsh.model.getParametrizationBounds(dim, tag), axis=0)
        normal = np.array(gmsh.model.getNormal(tag, middle))
        place = float(np.array(gmsh.model.getValue(dim, tag, middle)) @ normal)
        return "plane", np.array([*normal, place / size])
    if dim == 2 and (on := cylinder_of(dim, tag)) is not None:
        along = np.outer(on.axis, on.axis).ravel()  # both directions describe the same axis
        return "cylinder", np.array([*along, on.radius / size, *on.centre / size])
    return "face", np.zeros(1)


def cylinder_of(dim: int, tag: int) -> Cylinder | None:
    """Return the cylinder or circle of a face or curve, None without one."""
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
    shares = np.array([[0.5, 0.5], [0.3, 0.3], [0.6, 0.2], [0.2, 0.7]])
    places = (low + shares * (high - low)).ravel()
    point, *others = np.reshape(gmsh.model.getValue(dim, tag, places), (-1, 3))
    # Gmsh orients normals outwards, but not curvatures: the axis is on the side at which other
    # points have the same distance.
    normal, radius = np.array(gmsh.model.getNormal(tag, middle)), 1 / abs(curvature)
    centres = [point - side * radius * normal for side in (1.0, -1.0)]
    beside = np.array(others)[None] - np.array(centres)[:, None]
    across = beside - (beside @ axis)[:, :, None] * axis
    misses = np.abs(np.linalg.norm(across, axis=2) - radius).max(axis=1)
    side = int(np.argmin(misses))
    centre = centres[side]
    return Cylinder((radius, -radius)[side], axis, centre - (centre @ axis) * axis)


def round_of(dim: int, tag: int) -> str:
    """Return radius and axis of a face's cylinder in words; empty for other faces."""
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
