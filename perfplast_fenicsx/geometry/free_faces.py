"""List the free faces of bodies, and group faces in the same plane or on the same cylinder."""

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
    """Return gmsh's kind of a face or curve; for splines also "Plane", "Cylinder" or "Sphere"."""
    kind = str(gmsh.model.getType(dim, tag))
    # gmsh's kinds, in lower case, of faces that may be planes, cylinders or spheres
    untold = ("bspline surface", "bezier surface", "surface of revolution", "unknown")
    if dim != 2 or kind.lower() not in untold:
        return kind
    low, high = map(np.asarray, gmsh.model.getParametrizationBounds(2, tag))
    # fractions of the parameter ranges at which curvatures are evaluated; ends may be poles
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
    # curvature (times the size of the face) that counts as zero, and relative tolerance of equality
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
"""Difference up to which normals, radii and positions count as equal, relative to the size of the
body."""


@dataclass(frozen=True)
class FreeFace:
    """A face of the drawing (in the plane a curve) at which a body touches no other body.

    Attributes:
        number: Number of the face in the list and the picture.
        body: Index of the body.
        tag: Gmsh's tag of the face.
        colour: Colour of the face in the file; None if most of the body has the same colour.
        label: Label of the face in the file; "" if the face has no label.
    """

    number: int
    body: int
    tag: int
    colour: Colour | None = None
    label: str = ""


@dataclass(frozen=True)
class FaceSet:
    """Several free faces with a common name.

    Attributes:
        number: Number of the set in the list; 0 if the file or the user defines the set.
        name: Name in the mesh; "" before the set is named.
        faces: Indices of the faces in the list of free faces.
        why: The common property of the faces, in words.
    """

    number: int
    name: str
    faces: tuple[int, ...]
    why: str


@dataclass(frozen=True)
class Cylinder:
    """The cylinder on which a face lies; in the plane the circle of a curve.

    Attributes:
        radius: Radius (length); negative for the face of a hole, whose outward normal points to the
            axis.
        axis: Unit vector of the axis, whose largest component is positive.
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
    # words for gmsh's kinds, where they differ from gmsh's words
    words = {"Plane": "flat", "Line": "straight", "Circle": "round", "Ellipse": "round"}
    return words.get(kind, kind.removesuffix(" surface").lower())


def numbered_faces(
    dim: int, faces: Mapping[int, int], size: float, marks: Mapping[int, Mark]
) -> tuple[list[FreeFace], list[FaceSet]]:
    """Return the numbered free faces, and sets of similar faces, which have no names yet.

    Faces of one body are similar if they have the same label and colour. Faces without label and
    colour are similar if they lie in the same plane or on the same cylinder. Sets, and faces that
    belong to no set, are numbered first, from 1. The numbers of the faces in sets follow.

    Args:
        dim: Dimension of the faces.
        faces: Index of the body of each face, by tag.
        size: Size of the bodies.
        marks: Marks of faces that have a label or colour, by tag.

    Returns:
        The faces, sorted by body and number; and the sets.
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
    """Return the kind of each face by tag, and numbers that are equal for similar faces."""
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
    """Return "plane", "cylinder" or "face", and numbers that define the plane or cylinder."""
    if dim == 2 and kind_of(dim, tag) == "Plane":
        middle = np.mean(gmsh.model.getParametrizationBounds(dim, tag), axis=0)
        normal = np.array(gmsh.model.getNormal(tag, middle))
        place = float(np.array(gmsh.model.getValue(dim, tag, middle)) @ normal)
        return "plane", np.array([*normal, place / size])
    if dim == 2 and (on := cylinder_of(dim, tag)) is not None:
        # these numbers are the same for both directions of the axis
        along = np.outer(on.axis, on.axis).ravel()
        return "cylinder", np.array([*along, on.radius / size, *on.centre / size])
    return "face", np.zeros(1)


def cylinder_of(dim: int, tag: int) -> Cylinder | None:
    """Return the cylinder of a face or the circle of a curve; None for other shapes."""
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
    # Gmsh orients normals outwards, but curvatures have no orientation. The axis is on the side
    # on which the other points of the face also have the distance ``radius`` from the axis.
    normal, radius = np.array(gmsh.model.getNormal(tag, middle)), 1 / abs(curvature)
    centres = [point - side * radius * normal for side in (1.0, -1.0)]
    beside = np.array(others)[None] - np.array(centres)[:, None]
    across = beside - (beside @ axis)[:, :, None] * axis
    misses = np.abs(np.linalg.norm(across, axis=2) - radius).max(axis=1)
    side = int(np.argmin(misses))
    centre = centres[side]
    return Cylinder((radius, -radius)[side], axis, centre - (centre @ axis) * axis)


def round_of(dim: int, tag: int) -> str:
    """Return the kind, radius and axis of a face's cylinder in words; "" for other faces.

    A face that covers at least about half of its circle is a bore or a shaft, according to its
    outward normal. Smaller faces, such as fillets, are concave or convex.
    """
    on = cylinder_of(dim, tag)
    if on is None:
        return ""
    radius = f"R {abs(on.radius):.5g}"
    if dim == 1:
        return radius
    along = np.flatnonzero(np.abs(on.axis) > ALIKE)
    axis = np.round(on.axis, 3) + 0.0
    words = AXES[along[0]] if len(along) == 1 else f"({', '.join(f'{a:g}' for a in axis)})"
    half = 170.0  # smallest angle of a bore or shaft (degrees); each half of a bore covers 180
    kinds = ("bore", "shaft") if _angle_around(tag, on) >= half else ("concave", "convex")
    return f"{kinds[int(on.radius > 0)]}, {radius}, along {words}"


def _angle_around(tag: int, on: Cylinder) -> float:
    """Return the angle (degrees) that a cylindrical face covers around its axis."""
    low, high = map(np.asarray, gmsh.model.getParametrizationBounds(2, tag))
    count = 25  # samples along each parameter, 15 degrees apart on a full cylinder
    shares = np.linspace(0.0, 1.0, count)
    places = low + np.stack(np.meshgrid(shares, shares), axis=-1).reshape(-1, 2) * (high - low)
    normals = np.reshape(gmsh.model.getNormal(tag, places.ravel()), (-1, 3))
    first = np.cross(on.axis, np.eye(3)[np.argmin(np.abs(on.axis))])
    first /= np.linalg.norm(first)
    turned = np.arctan2(normals @ np.cross(on.axis, first), normals @ first)
    around = np.sort(np.degrees(turned))
    gaps = np.diff(np.append(around, around[0] + 360.0))
    step = 360.0 / (count - 1)
    return float(360.0 if gaps.max() < 1.5 * step else 360.0 - gaps.max())
