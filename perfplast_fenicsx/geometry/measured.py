"""Measure bodies, joints and free faces in gmsh's current model and mesh."""

from collections.abc import Mapping, Sequence
from collections.abc import Set as AbstractSet

import gmsh
import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.geometry.face_labels import hex_of, word_of
from perfplast_fenicsx.geometry.free_faces import (
    FaceSet,
    FreeFace,
    cylinder_of,
    round_of,
    shape_of,
)
from perfplast_fenicsx.geometry.joints import Seam
from perfplast_fenicsx.geometry.parts import Part
from perfplast_fenicsx.geometry.survey import Body, Face, Joint, NamedFaces
from perfplast_fenicsx.rounding import ROUNDING


def cad_measure(dim: int, tags: Sequence[int]) -> float | None:
    """Return the volume, area or length of entities in CAD; None for gmsh's built-in kernel."""
    known = {tag for of, tag in gmsh.model.occ.getEntities(dim) if of == dim}
    if not known.issuperset(tags):
        return None
    return float(sum(gmsh.model.occ.getMass(dim, tag) for tag in tags))


def mesh_measure(dim: int, tag: int) -> float:
    """Return the volume, area or length of an entity's elements, which may be curved."""
    return float(_quadrature(dim, tag)[1].sum())


def mesh_centre(dim: int, tags: Sequence[int]) -> Floats:
    """Return the centroid of the elements of entities, which may be curved, shape (3,)."""
    found = [_quadrature(dim, tag) for tag in tags]
    points, weights = (np.concatenate(arrays) for arrays in zip(*found, strict=True))
    return np.asarray(weights @ points / weights.sum())


def _quadrature(dim: int, tag: int) -> tuple[Floats, Floats]:
    """Return quadrature points in an entity, shape (n, 3), and weights that sum to its measure."""
    points, weights = [np.empty((0, 3))], [np.empty(0)]
    gauss = "Gauss4"  # this rule is exact for volumes of curved elements
    for kind in gmsh.model.mesh.getElementTypes(dim, tag):
        local, of_rule = gmsh.model.mesh.getIntegrationPoints(kind, gauss)
        _, determinants, places = gmsh.model.mesh.getJacobians(kind, local, tag)
        points.append(places.reshape(-1, 3))
        weights.append((determinants.reshape(-1, of_rule.size) * of_rule).ravel())
    return np.concatenate(points), np.concatenate(weights)


def missed_areas(dim: int, parts: Sequence[Part]) -> dict[int, float]:
    """Return the relative error of the area of each large face in the mesh.

    In the plane, the faces are curves and the areas lengths. Faces with an unknown area are
    omitted.
    """
    tags = [tag for part in parts for tag in part.tags]
    faces = sorted({int(f) for tag in tags for f in gmsh.model.getAdjacencies(dim, tag)[1]})
    meant = [(face, cad_measure(dim - 1, [face])) for face in faces]
    known = {face: area for face, area in meant if area}
    # the area of a face must be accurate if its share of the total area is not smaller
    matters = 0.01
    least = matters * sum(known.values())
    return {
        face: abs(mesh_measure(dim - 1, face) / area - 1)
        for face, area in known.items()
        if area > least
    }


def measured_body(dim: int, part: Part) -> Body:
    """Make a body a physical group, and return its measures."""
    gmsh.model.addPhysicalGroup(dim, part.tags, name=part.name)
    points = np.concatenate([_coordinates(dim, tag) for tag in part.tags])
    around = np.array([points.min(axis=0), points.max(axis=0)])
    around[abs(around) < ROUNDING * np.linalg.norm(around[1] - around[0])] = 0.0
    low, high = (tuple(float(x) for x in end) for end in around)
    return Body(
        name=part.name,
        label=part.label,
        volume=sum(mesh_measure(dim, tag) for tag in part.tags),
        low=low,
        high=high,
        cells=elements(dim, part).size,
        worst=float(qualities(dim, part).min()),
        cad=cad_measure(dim, part.tags),
    )


def measured_joint(
    dim: int,
    parts: Sequence[Part],
    number: int,
    seam: Seam,
    shared: AbstractSet[frozenset[str]],
) -> Joint:
    """Make a joint a physical group (two groups if meshed apart), and return its measures.

    Args:
        dim: Dimension of the bodies.
        parts: The bodies.
        number: Number of the joint.
        seam: The faces.
        shared: Names of pairs of bodies that share faces in the drawing.
    """
    name = f"joint_{number}"
    one, other = (parts[body].name for body in seam.bodies)
    sides = (f"{one}_{name}", f"{other}_{name}")
    if seam.faces[0] == seam.faces[1]:
        gmsh.model.addPhysicalGroup(dim - 1, seam.faces[0], name=name)
    else:
        for side, faces in zip(sides, seam.faces, strict=True):
            gmsh.model.addPhysicalGroup(dim - 1, faces, name=side)
    shapes = tuple(sorted({shape_of(dim - 1, face) for face in seam.faces[0]}))
    area = sum(mesh_measure(dim - 1, face) for face in seam.faces[0])
    drawn = cad_measure(dim - 1, seam.faces[0])
    bodies = parts[seam.bodies[0]], parts[seam.bodies[1]]
    bore = _around(bodies, seam.faces[0]) if shapes == ("cylindrical",) else ""
    both = frozenset((one, other)) in shared
    return Joint((one, other), sides, area, shapes, both, drawn, bore)


def _around(bodies: tuple[Part, Part], faces: Sequence[int]) -> str:
    """Return the name of the body that lies outside cylindrical faces; "" if both or none do."""
    outside = set[str]()
    beyond = 1e-3  # distance of the examined point from the face, relative to the radius
    for face in faces:
        on = cylinder_of(2, face)
        assert on is not None  # the face is cylindrical
        bounds = gmsh.model.getParametrizationBounds(2, face)
        point = np.array(gmsh.model.getValue(2, face, np.mean(bounds, axis=0)))
        out = point - on.centre
        place = point + beyond * (out - (out @ on.axis) * on.axis)
        outside |= {
            part.name
            for part in bodies
            if any(gmsh.model.isInside(3, tag, place) for tag in part.tags)
        }
    return outside.pop() if len(outside) == 1 else ""


def measured_faces(
    dim: int, parts: Sequence[Part], faces: Sequence[FreeFace], names: Sequence[str], size: float
) -> list[Face]:
    """Make each free face a physical group, and return the measures of the faces."""
    found = []
    for face, name in zip(faces, names, strict=True):
        gmsh.model.addPhysicalGroup(dim - 1, [face.tag], name=name)
        middle = mesh_centre(dim - 1, [face.tag])
        middle[abs(middle) < ROUNDING * size] = 0.0
        found.append(
            Face(
                face.number,
                name,
                parts[face.body].name,
                _shape(dim - 1, face),
                mesh_measure(dim - 1, face.tag),
                tuple(float(x) for x in middle),
                cad_measure(dim - 1, [face.tag]),
                round_of(dim - 1, face.tag),
            )
        )
    return found


def measured_sets(
    dim: int,
    parts: Sequence[Part],
    faces: Sequence[FreeFace],
    sets: Sequence[FaceSet],
    seams: Sequence[Seam],
    of_file: Mapping[str, AbstractSet[int]],
    cracks: Sequence[tuple[str, str]],
) -> tuple[list[NamedFaces], list[str]]:
    """Make each named set of faces a physical group; return the measured sets, and remarks.

    Args:
        dim: Dimension of the bodies.
        parts: The bodies.
        faces: Free faces.
        sets: Sets of these faces.
        seams: Places where bodies touch.
        of_file: Tags of faces by name in the file. Faces at seams get a name for each side, such as
            ``lower_seam`` and ``upper_seam``.
        cracks: Names of both sides of each open crack.
    """
    found, remarks = [], list[str]()
    free = {one.name: one for one in sets}
    open_ = {name for pair in cracks for name in pair}
    for name in dict.fromkeys([*free, *of_file]):
        one = free.get(name, FaceSet(0, name, (), ""))
        tags = [faces[k].tag for k in one.faces]
        sides = _sides_of_seams(seams, of_file.get(name, frozenset()))
        if name in open_:
            along = sorted(of_file[name])
            gmsh.model.addPhysicalGroup(dim - 1, along, name=name)
            area = sum(mesh_measure(dim - 1, tag) for tag in along)
            why = "a side of an open crack"
            found.append(NamedFaces(0, name, (), why, area, cad_measure(dim - 1, along)))
            continue
        if not tags and not sides:
            remarks.append(f"the physical group '{name}' bounds no body and is ignored")
            continue
        if tags:
            numbers = tuple(faces[k].number for k in one.faces)
            measures = sum(mesh_measure(dim - 1, tag) for tag in tags), cad_measure(dim - 1, tags)
            found.append(NamedFaces(one.number, name, numbers, one.why, *measures))
        shared = {tag for _, some in sides for tag in some if sum(tag in s for _, s in sides) > 1}
        if tags or shared:
            gmsh.model.addPhysicalGroup(dim - 1, [*tags, *sorted(shared)], name=name)
        for body, some in sides:
            side = f"{parts[body].name}_{name}"
            if not shared >= {*some}:  # true if the bodies are meshed apart
                gmsh.model.addPhysicalGroup(dim - 1, some, name=side)
            area = sum(mesh_measure(dim - 1, tag) for tag in some)
            why = f"'{name}' in the file, where bodies touch"
            found.append(NamedFaces(0, side, (), why, area, cad_measure(dim - 1, some)))
    return found, remarks


def _sides_of_seams(seams: Sequence[Seam], tags: AbstractSet[int]) -> list[tuple[int, list[int]]]:
    """Return the bodies that have faces of ``tags`` at seams, each with these faces."""
    found: dict[int, list[int]] = {}
    for seam in seams:
        for body, faces in zip(seam.bodies, seam.faces, strict=True):
            if some := [face for face in faces if face in tags]:
                found.setdefault(body, []).extend(some)
    return sorted(found.items())


def _shape(dim: int, face: FreeFace) -> str:
    """Return the shape of a face, such as "flat", with its label and colour."""
    shape = shape_of(dim, face.tag)
    if face.label:
        shape += f", '{face.label}'"
    if face.colour is None:
        return shape
    return f"{shape}, {word_of(face.colour)} {hex_of(face.colour)}"


def elements(dim: int, part: Part) -> npt.NDArray[np.uint64]:
    """Return gmsh's tags of the elements of a body."""
    return np.concatenate(
        [np.empty(0, np.uint64)]
        + [tags for tag in part.tags for tags in gmsh.model.mesh.getElements(dim, tag)[1]]
    )


def qualities(dim: int, part: Part) -> Floats:
    """Return the qualities of a body's elements: 1 for equilateral and 0 for flat elements."""
    return np.asarray(gmsh.model.mesh.getElementQualities(elements(dim, part), "minSICN"))


def nodes_of(dim: int, part: Part) -> int:
    """Return the number of nodes of a body."""
    nodes = [n for tag in part.tags for n in gmsh.model.mesh.getElements(dim, tag)[2]]
    return np.unique(np.concatenate(nodes)).size


def _coordinates(dim: int, tag: int) -> Floats:
    found = gmsh.model.mesh.getNodes(dim, tag, includeBoundary=True, returnParametricCoord=False)
    return np.asarray(found[1]).reshape(-1, 3)
