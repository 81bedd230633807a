"""Mesh a geometry file as bodies with names, and survey its content, in one process."""

import math
from collections.abc import Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from itertools import combinations
from pathlib import Path
from typing import Any

import gmsh
import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.errors import InputError, nearest
from perfplast_fenicsx.geometry.face_labels import (
    Mark,
    labels_of,
    set_aside,
    set_aside_named,
    take_back,
)
from perfplast_fenicsx.geometry.face_names import face_names
from perfplast_fenicsx.geometry.free_faces import FreeFace, numbered_faces
from perfplast_fenicsx.geometry.generated_mesh import (
    EXACT,
    POOR,
    mesh_with_areas,
    regular_edge,
    with_scripted,
)
from perfplast_fenicsx.geometry.geometry_file import is_script
from perfplast_fenicsx.geometry.joints import (
    Seam,
    box,
    cut_along_each_other,
    faces_of_bodies,
    find_seams,
    free_faces,
    near_misses,
    take_apart,
)
from perfplast_fenicsx.geometry.kept_mesh import Stage, begin
from perfplast_fenicsx.geometry.measured import (
    measured_body,
    measured_faces,
    measured_joint,
    measured_sets,
    missed_areas,
    nodes_of,
    qualities,
)
from perfplast_fenicsx.geometry.meshing_options import AXES, MeshingOptions
from perfplast_fenicsx.geometry.part_names import cracks_among
from perfplast_fenicsx.geometry.parts import Drawing, Part, read_parts
from perfplast_fenicsx.geometry.survey import Body, Face, Joint, Survey
from perfplast_fenicsx.mesh.split_bodies import write_split


def groups_of(bodies: Sequence[str], joints: Sequence[Joint]) -> list[list[str]]:
    """Return groups of bodies that are connected by joints, in the order of the bodies."""
    group = {body: [body] for body in bodies}
    for joint in joints:
        one, other = (group[body] for body in joint.bodies)
        if one is not other:
            one += other
            group.update(dict.fromkeys(other, one))
    return list({id(members): members for members in group.values()}.values())


def apart_remarks(bodies: Sequence[str], joints: Sequence[Joint]) -> Iterator[str]:
    """Yield a remark if there are groups of bodies that do not touch each other."""
    groups = groups_of(bodies, joints)
    if len(groups) < 2:
        return
    most_names = 8  # largest number of groups whose bodies are named
    names = ["'" + "' with '".join(group) + "'" for group in groups[:most_names]]
    rest = f" and {len(groups) - most_names} more" if len(groups) > most_names else ""
    yield (
        f"{', '.join(names)}{rest} do not touch each other: give each of them separate supports "
        f"and loads, or leave bodies out (--without {groups[-1][0]})"
    )


def volume_remarks(dim: int, bodies: Sequence[Body]) -> Iterator[str]:
    """Yield a remark if volumes of bodies in the mesh differ too much from those in the file.

    Args:
        dim: Dimension of the bodies.
        bodies: The measures of the bodies.
    """
    much = 0.02  # error of a volume, of the order of the error of the body's strength
    errors = {body: body.volume / body.cad - 1 for body in bodies if body.cad}
    wrong = sorted((body for body in errors if abs(errors[body]) > much), key=lambda of: errors[of])
    if not wrong:
        return
    most_names = 3
    names = [f"'{body.name}' ({100 * errors[body]:+.2g} %)" for body in wrong[:most_names]]
    rest = f" and {len(wrong) - most_names} more" if len(wrong) > most_names else ""
    worst = max(wrong, key=lambda of: abs(errors[of]))
    # errors are of second order in edge lengths
    edge = regular_edge(dim, worst.volume / worst.cells)
    finer = edge * math.sqrt(much / abs(errors[worst]))
    quantity = "volume" if dim == 3 else "area"
    yield (
        f"meshes of bodies differ in {quantity} from the drawing: {', '.join(names)}{rest}; "
        "straight edges replace curves, and strengths have errors of this order: give a smaller "
        f"size (--size-of {worst.name}={finer:.2g})"
    )


def area_remarks(
    missed: float, faces: Sequence[Face] = (), joints: Sequence[Joint] = ()
) -> Iterator[str]:
    """Yield a remark if the mesh misses the area of a large face by too large a fraction.

    Args:
        missed: Largest relative error of the mesh's area, over all large faces.
        faces: Free faces, large and small ones. The remark names the face with the largest error.
        joints: Places where bodies touch.
    """
    areas = [(one.name, one.area, one.cad) for one in faces]
    areas += [(one.surfaces[0], one.area, one.cad) for one in joints]
    errors = {name: abs(area / drawn - 1) for name, area, drawn in areas if drawn}
    worst = max(errors, key=lambda name: errors[name], default="")
    most, large = max(errors.get(worst, 0.0), missed), ""
    whose = f" ('{worst}')" if errors.get(worst, 0.0) >= most else ""
    if f"{most:.2g}" != f"{missed:.2g}":
        large = f", those of large faces up to {100 * missed:.2g} %"
    if missed > EXACT:
        yield (
            f"areas of faces have errors up to {100 * most:.2g} %{whose}{large}, because polygons "
            "approximate circles, and forces from pressures have the same errors: give more "
            "elements around a circle (--curvature), or give a traction as total force (total = "
            "true)"
        )


def straighten(parts: Sequence[Part], seams: Sequence[Seam]) -> None:
    """Move nodes of the mesh onto the original surfaces of the faces.

    When a gap is closed, edges of one body are replaced by edges of the other body's face, which
    lie at the distance of the gap. The new edges bend the face, and contact on a bent face would
    push the bodies sideways.

    Args:
        parts: Bodies in 3D.
        seams: Places where they touch.

    Raises:
        InputError: If elements fold over.
    """
    faces = sorted({face for seam in seams for side in seam.faces for face in side})
    sweeps = 3  # nodes on several faces converge to the intersection of these faces
    for _ in range(sweeps):
        for face in faces:
            nodes, points, _ = gmsh.model.mesh.getNodes(2, face, includeBoundary=True)
            closest, _ = gmsh.model.getClosestPoint(2, face, points)
            for node, point in zip(nodes, np.reshape(closest, (-1, 3)), strict=True):
                gmsh.model.mesh.setNode(int(node), point, [])
    for part in parts:
        if qualities(3, part).min() <= 0:
            raise InputError(
                f"closing the gaps folds elements of '{part.name}'; give a larger size or a "
                "smaller close_gaps, or repair the geometry in the CAD system."
            )


def without(dim: int, parts: Sequence[Part], names: Sequence[str]) -> list[Part]:
    """Remove bodies from gmsh's current model, and return the others.

    Args:
        dim: Dimension of the bodies.
        parts: All bodies.
        names: Names of the bodies to leave out.

    Raises:
        InputError: If a body does not exist, or if none remains.
    """
    known = [part.name for part in parts]
    for name in names:
        if name not in known:
            raise InputError(
                f"the option 'without' contains '{name}', which is not a body; "
                f"{nearest(name, known)}"
            )
    kept = [part for part in parts if part.name not in names]
    if not kept:
        raise InputError(
            "the option 'without' contains all bodies; remove at least one of them from it."
        )
    gone = [(dim, tag) for part in parts if part.name in names for tag in part.tags]
    kernels = (gmsh.model.occ, gmsh.model.geo)
    for kernel in kernels:
        made = set(gmsh.model.occ.getEntities(dim))
        here = [one for one in gone if (one in made) == (kernel is gmsh.model.occ)]
        if here:
            kernel.remove(here, recursive=True)
            kernel.synchronize()
    return kept


def cut_in_half(dim: int, parts: Sequence[Part], planes: Mapping[str, float]) -> list[Part]:
    """Cut the bodies at planes of symmetry, and keep the parts with larger coordinates.

    Args:
        dim: Dimension of the bodies.
        parts: The bodies; cut bodies get new entities, and entities on the other side are removed.
        planes: Position of each plane by coordinate.

    Raises:
        InputError: If the bodies are not symmetric, or if they belong to gmsh's built-in kernel and
            cannot be cut.
    """
    for axis, value in planes.items():
        if AXES.index(axis) >= dim:
            raise InputError(f"symmetry: a plane model has no {axis}; give x or y.")
        if {(dim, t) for part in parts for t in part.tags} - set(gmsh.model.occ.getEntities(dim)):
            raise InputError(
                "symmetry: bodies of gmsh's built-in kernel cannot be cut; begin the file with"
                ' SetFactory("OpenCASCADE"), or model one half.'
            )
        parts = _half(dim, parts, axis, value)
    return list(parts)


def _half(dim: int, parts: Sequence[Part], axis: str, value: float) -> list[Part]:
    along = AXES.index(axis)
    around = np.array([box(dim, part.tags) for part in parts])
    low, high = around[:, 0].min(axis=0), around[:, 1].max(axis=0)
    size = float(np.linalg.norm(high - low))
    if not low[along] < value < high[along]:
        raise InputError(
            f"symmetry: {axis} = {value:g} lies outside the bodies, which reach from"
            f" {low[along]:.6g} to {high[along]:.6g}; give a plane through them."
        )
    volume, centre = _mass(dim, parts)
    kept = []
    for part in parts:
        tags = tuple(new for tag in part.tags for new in _upper(dim, tag, along, value, size))
        if tags:
            kept.append(Part(part.name, part.label, tags))
    gmsh.model.occ.synchronize()
    half, of_half = _mass(dim, kept)
    beside = np.arange(3) != along
    across = float(abs(centre - of_half)[beside].max())
    # allowed relative difference of the volumes of both halves, and of the centres relative to the
    # size
    unequal = 1e-3
    same = abs(2 * half - volume) <= unequal * volume and across <= unequal * size
    if not same or abs(centre[along] - value) > unequal * size:
        raise InputError(
            f"symmetry: the bodies are not symmetric about {axis} = {value:g}: their centre is at "
            f"{axis} = {centre[along]:.6g}, and {half / volume:.1%} of their "
            f"{'volume' if dim == 3 else 'area'} lies on the kept side; give another plane, or "
            "remove it."
        )
    return kept


def _upper(dim: int, tag: int, along: int, value: float, size: float) -> list[int]:
    """Cut an entity at a plane, and return the tags of its parts on the kept side."""
    occ = gmsh.model.occ
    low, high = box(dim, [tag])
    if high[along] <= value + 1e-6 * size:
        occ.remove([(dim, tag)], recursive=True)
        return []
    if low[along] >= value - 1e-6 * size:
        return [tag]
    corner, edges = low - size, high - low + 2 * size
    corner[along], edges[along] = value, high[along] - value + size
    if dim == 3:
        room = occ.addBox(*corner, *edges)
    else:
        points = gmsh.model.getBoundary([(dim, tag)], combined=False, recursive=True)
        # from a point of the body, because its bounding box is slightly too large
        plane = gmsh.model.getValue(0, points[0][1], [])[2]
        room = occ.addRectangle(corner[0], corner[1], plane, edges[0], edges[1])
    found, _ = occ.intersect([(dim, tag)], [(dim, room)])
    return [new for of, new in found if of == dim]


def _mass(dim: int, parts: Sequence[Part]) -> tuple[float, Floats]:
    """Return the volume of bodies and their centroid."""
    occ, tags = gmsh.model.occ, [tag for part in parts for tag in part.tags]
    masses = np.array([occ.getMass(dim, tag) for tag in tags])
    centres = np.array([occ.getCenterOfMass(dim, tag) for tag in tags]).reshape(-1, 3)
    return float(masses.sum()), masses @ centres / masses.sum()


def skin_of(
    dim: int,
    parts: Sequence[Part],
    free: Sequence[FreeFace],
    faces: Sequence[Face],
    seams: Sequence[Seam],
) -> dict[str, Any]:
    """Return the visible triangles of the bodies in gmsh's current mesh, for pictures.

    Args:
        dim: Dimension of the bodies.
        parts: The bodies.
        free: Free faces.
        faces: The same faces with their measures.
        seams: Faces at which bodies touch.

    Returns:
        Arrays by name. ``points``, shape (n, 3). ``triangles``, shape (m, 3), with the index
        ``body`` of each triangle and the number ``face`` of its free face, from 1 (0 for plane
        bodies, whose faces are curves). ``names`` of the bodies. ``places``, points on free
        faces, shape (k, 3), with the ``numbers`` of these faces. ``outlines`` of seams, shape (s,
        2), with the index ``seam`` of each line. For plane bodies also ``segments``, the lines of
        free faces, shape (t, 2), with the number ``segment_face`` of each line's face.
    """
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    order = np.argsort(tags)
    tags, points = tags[order], coordinates.reshape(-1, 3)[order]
    shown: list[tuple[int, int, tuple[int, ...]]] = [
        (face.body, face.number, (face.tag,)) for face in free
    ]
    if dim == 2:
        shown = [(number, 0, part.tags) for number, part in enumerate(parts)]
    triangles, owners, faces_of, places = [], [], [], []
    for number, face_number, entities in shown:
        corners = np.searchsorted(tags, _corners(entities, 2))
        triangles.append(corners)
        owners.append(np.full(len(corners), number))
        faces_of.append(np.full(len(corners), face_number))
    for one, face in zip(free, faces, strict=True):
        middles = points[np.searchsorted(tags, _corners([one.tag], dim - 1))].mean(axis=1)
        distance = np.linalg.norm(middles - face.centre, axis=1)
        places.append(middles[np.argmin(distance)])
    ends = {number: _ends(tags, dim, seam.faces[0]) for number, seam in enumerate(seams)}
    free_ends = {face.number: _ends(tags, dim, [face.tag]) for face in free if dim == 2}
    return {
        **_numbered(ends, "outlines", "seam"),
        **_numbered(free_ends, "segments", "segment_face"),
        "points": points,
        "triangles": np.concatenate(triangles),
        "body": np.concatenate(owners),
        "face": np.concatenate(faces_of),
        "names": np.array([part.name for part in parts]),
        "places": np.array(places).reshape(-1, 3),
        "numbers": np.array([face.number for face in faces]),
    }


def _ends(tags: npt.NDArray[np.uint64], dim: int, faces: Sequence[int]) -> npt.NDArray[np.int64]:
    """Return the ends of the lines on the outline of faces; in the plane, of all their lines."""
    corners = np.searchsorted(tags, _corners(faces, dim - 1)).astype(np.int64)
    if dim == 2:
        return corners
    edges = np.sort(corners[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    once, counts = np.unique(edges, axis=0, return_counts=True)
    return np.asarray(once[counts == 1], dtype=np.int64)


def _numbered(
    ends: dict[int, npt.NDArray[np.int64]], lines: str, numbers: str
) -> dict[str, npt.NDArray[np.int64]]:
    """Return two arrays by name: the lines in ``ends``, and the key of each line."""
    counts = [len(one) for one in ends.values()]
    return {
        lines: np.concatenate([np.zeros((0, 2), dtype=np.int64), *ends.values()]),
        numbers: np.repeat(np.array(list(ends), dtype=np.int64), counts),
    }


def _corners(entities: Sequence[int], dim: int) -> npt.NDArray[np.uint64]:
    """Return the vertices of the elements of entities, shape (num_elements, dim + 1)."""
    found = []
    for entity in entities:
        kinds, _, nodes = gmsh.model.mesh.getElements(dim, entity)
        for kind, array in zip(kinds, nodes, strict=True):
            size = gmsh.model.mesh.getElementProperties(kind)[3]
            found.append(array.reshape(-1, size)[:, : dim + 1])
    return np.concatenate(found)


MOST_THIN = 0.5
"""Largest share of a body's elements that may reach through its thickness without a remark."""


def share_through(dim: int, part: Part) -> float:
    """Return the share of a body's elements that have an edge between opposite sides."""
    cells = []
    for tag in part.tags:
        kinds, _, nodes = gmsh.model.mesh.getElements(dim, tag)
        for kind, numbers in zip(kinds, nodes, strict=True):
            size = gmsh.model.mesh.getElementProperties(kind)[3]
            cells.append(numbers.reshape(-1, size)[:, : dim + 1])
    corners = np.concatenate(cells).astype(np.int64)
    tags, points, _ = gmsh.model.mesh.getNodes()
    order = np.argsort(tags)
    numbers, local = np.unique(corners, return_inverse=True)
    places = np.asarray(points).reshape(-1, 3)[order[np.searchsorted(tags[order], numbers)]]
    return through(places[:, :dim], local.reshape(corners.shape))


def through(points: Floats, cells: Longs) -> float:
    """Return the share of simplices that have an edge whose ends have opposite outward normals.

    Args:
        points: Coordinates, shape (num_points, d).
        cells: Vertices of the simplices, shape (num_cells, d + 1).
    """
    dim = points.shape[1]
    facets = np.concatenate([np.delete(cells, corner, axis=1) for corner in range(dim + 1)])
    behind = np.concatenate([cells[:, corner] for corner in range(dim + 1)])
    _, first, count = np.unique(
        np.sort(facets, axis=1), axis=0, return_index=True, return_counts=True
    )
    outer, inside = facets[first[count == 1]], behind[first[count == 1]]
    edges = points[outer[:, 1:]] - points[outer[:, :1]]
    if dim == 3:
        normals = np.cross(edges[:, 0], edges[:, 1])
    else:
        normals = np.column_stack([edges[:, 0, 1], -edges[:, 0, 0]])
    inwards = np.einsum("ni,ni->n", normals, points[inside] - points[outer[:, 0]]) > 0
    normals[inwards] *= -1
    at_points = np.zeros_like(points)
    np.add.at(at_points, outer.ravel(), np.repeat(normals, dim, axis=0))
    sizes = np.linalg.norm(at_points, axis=1, keepdims=True)
    at_points /= np.where(sizes > 0, sizes, 1.0)  # vertices inside the body have no normal
    reaches = np.zeros(len(cells), dtype=np.bool_)
    # surfaces are opposite sides if the cosine of the angle between their outward normals is below
    # this value
    opposite = -0.8
    for a, b in combinations(range(dim + 1), 2):
        cosines = np.einsum("ni,ni->n", at_points[cells[:, a]], at_points[cells[:, b]])
        reaches |= cosines < opposite
    return float(reaches.mean())


def mesh_file(source: Path, target: Path, options: MeshingOptions) -> Survey:
    """Read a geometry file into gmsh's current model, mesh the bodies, and write the mesh.

    Args:
        source: A STEP, BREP, IGES or gmsh .geo file.
        target: The .msh file to write; the visible triangles go to an .npz file next to it.
        options: Sizes, degree of the elements, symmetry and names of faces.

    Raises:
        InputError: If the file cannot be read or has no bodies, or if a body cannot be meshed.
    """
    begin(Stage("reading it"))
    drawing = read_parts(source)
    dim, parts, remarks, smallest = drawing.dim, drawing.parts, [*drawing.remarks], 0.0
    if is_script(source):
        options, smallest, unused = with_scripted(options)
        remarks += unused
    shared = _shared(dim, parts)
    labels, unsure = labels_of(source, parts)
    remarks += unsure
    begin(Stage("cutting its bodies along each other"))
    if is_script(source):
        marks = set_aside_named(dim - 1, drawing.named)
    else:
        marks = set_aside(parts, labels)
    parts = without(dim, parts, options.without)
    parts = cut_in_half(dim, parts, options.symmetry)
    parts = cut_along_each_other(dim, parts, options.overlap, options.close_gaps)
    near = near_misses(dim, parts)
    edges = [pair for pair in near if pair.gap == 0]
    near = [pair for pair in near if pair.gap > 0]
    seams = find_seams(dim, parts)
    if options.meshed == "apart":
        parts, seams = take_apart(dim, parts, seams)
    extent = max(float(np.linalg.norm(np.ptp(box(dim, part.tags), axis=0))) for part in parts)
    free = free_faces(dim, parts, seams)
    every = faces_of_bodies(dim, parts) if is_script(source) else free
    marked = take_back(dim - 1, marks, every, parts)
    of_file = _by_name(dim - 1, drawing, marked)
    if of_file:
        marked = {}
    cracks = cracks_among(of_file, _inside_bodies(parts)) if dim == 2 else []
    faces, alike = numbered_faces(dim - 1, free, extent, marked)
    names, sets = face_names(dim - 1, parts, faces, alike, options, of_file)
    begin(Stage("meshing", _names_of_faces(dim, parts)))
    sliding = [] if is_script(source) else _sliding(dim, parts, seams, shared)
    longest = mesh_with_areas(dim, parts, options, sliding, smallest)
    longest *= gmsh.option.getNumber("Mesh.MeshSizeFactor")
    if options.close_gaps and dim == 3:
        straighten(parts, seams)
    missed = max(missed_areas(dim, parts).values(), default=0.0)

    gmsh.model.removePhysicalGroups()
    bodies = [measured_body(dim, part) for part in parts]
    joints = [measured_joint(dim, parts, k, s, shared) for k, s in enumerate(seams, start=1)]
    measured = measured_faces(dim, parts, faces, names, extent)
    named, left_out = measured_sets(dim, parts, faces, sets, seams, of_file, cracks)
    np.savez(target.with_suffix(".npz"), **skin_of(dim, parts, faces, measured, seams))
    write_split(target, cracks)
    remarks += left_out + [
        f"the worst element of '{body.name}' is nearly flat (quality {body.worst:.1e}): give a "
        "smaller size, or remove tiny faces from the geometry"
        for body in bodies
        if body.worst < POOR
    ]
    remarks += [
        f"{' and '.join(map(repr, pair.bodies))} touch only along an edge or at a point, so there "
        "is no contact between them"
        for pair in edges
    ]
    remarks += [
        f"'{part.name}' has one element through its thickness in most places, but bending needs at "
        f"least two elements: give a smaller size (--size-of {part.name}=H)"
        for part in parts
        if share_through(dim, part) > MOST_THIN
    ]
    remarks += apart_remarks([part.name for part in parts], joints)
    remarks += [*volume_remarks(dim, bodies), *area_remarks(missed, measured, joints)]
    told = (joints, near, measured, remarks, longest, named)
    return Survey(dim, options.order, sum(nodes_of(dim, part) for part in parts), bodies, *told)


def _inside_bodies(parts: Sequence[Part]) -> set[int]:
    """Return the curves of gmsh's plane model that have the same body on both sides."""
    body = {tag: number for number, part in enumerate(parts) for tag in part.tags}
    found = set[int]()
    for _, curve in gmsh.model.getEntities(1):
        beside = [body.get(int(tag), -1) for tag in gmsh.model.getAdjacencies(1, curve)[0]]
        # no surface ends at the curve, or two surfaces of one body do
        if len(beside) != 1 and len({*beside}) <= 1:
            found.add(curve)
    return found


def _shared(dim: int, parts: Sequence[Part]) -> set[frozenset[str]]:
    """Return the names of pairs of bodies that share faces in the drawing."""
    return {frozenset(parts[k].name for k in seam.bodies) for seam in find_seams(dim, parts)}


def _sliding(
    dim: int, parts: Sequence[Part], seams: Sequence[Seam], shared: AbstractSet[frozenset[str]]
) -> list[int]:
    """Return the faces in space at which bodies touch but share no face in the drawing."""
    found = dict[int, None]()
    for seam in seams:
        if dim == 3 and frozenset(parts[k].name for k in seam.bodies) not in shared:
            found |= dict.fromkeys(tag for side in seam.faces for tag in side)
    return list(found)


def _names_of_faces(dim: int, parts: Sequence[Part]) -> dict[int, str]:
    """Return the name of the body for each of its faces (in the plane for each of its entities)."""
    names = {}
    for part in reversed(parts):
        for tag in part.tags:
            faces = [tag] if dim == 2 else gmsh.model.getAdjacencies(dim, tag)[1]
            names.update({int(face): part.name for face in faces})
    return names


def _by_name(dim: int, drawing: Drawing, marked: Mapping[int, Mark]) -> dict[str, set[int]]:
    """Return the faces with each name of a script, after bodies have been cut.

    Args:
        dim: Dimension of the faces.
        drawing: The drawing; cuts do not change faces of gmsh's built-in kernel.
        marked: Marks of faces in OpenCASCADE's kernel that coincide with named faces.
    """
    here = {tag for _, tag in gmsh.model.getEntities(dim)}
    made = {tag for _, tag in gmsh.model.occ.getEntities(dim)}
    found = {name: ({*tags} & here) - made for name, tags in drawing.named.items()}
    for tag, mark in marked.items():
        for name in mark.names:
            found[name].add(tag)
    return found
