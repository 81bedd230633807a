"""Mesh a geometry file as bodies with names, and survey its contents. Single-process."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import gmsh
import numpy as np

from perfplast_fenicsx.geometry import thickness
from perfplast_fenicsx.geometry.apart import apart_remarks
from perfplast_fenicsx.geometry.automatic_mesh import EXACT, mesh_with_areas
from perfplast_fenicsx.geometry.cad_measures import missed_areas
from perfplast_fenicsx.geometry.closed_gaps import straighten
from perfplast_fenicsx.geometry.face_colours import Mark, set_aside, set_aside_named, take_back
from perfplast_fenicsx.geometry.face_labels import labels_of
from perfplast_fenicsx.geometry.face_names import face_names
from perfplast_fenicsx.geometry.free_faces import numbered_faces
from perfplast_fenicsx.geometry.generated_mesh import POOR
from perfplast_fenicsx.geometry.geometry_file import is_script
from perfplast_fenicsx.geometry.joints import box, cut_along_each_other, near_misses
from perfplast_fenicsx.geometry.left_out_bodies import without
from perfplast_fenicsx.geometry.measured import (
    measured_body,
    measured_faces,
    measured_joint,
    measured_sets,
    nodes_of,
)
from perfplast_fenicsx.geometry.meshing_options import MeshingOptions
from perfplast_fenicsx.geometry.parts import Drawing, Part, read_parts
from perfplast_fenicsx.geometry.progress import Stage, begin
from perfplast_fenicsx.geometry.seams import (
    faces_of_bodies,
    find_seams,
    free_faces,
    take_apart,
)
from perfplast_fenicsx.geometry.skin import skin_of
from perfplast_fenicsx.geometry.survey import Survey
from perfplast_fenicsx.geometry.symmetry import cut_in_half
from perfplast_fenicsx.geometry.thickness import share_through
from perfplast_fenicsx.mesh.split_bodies import write_split


def mesh_file(source: Path, target: Path, options: MeshingOptions) -> Survey:
    """Read a geometry file into gmsh's current model, mesh it, and write a .msh and an .npz file.

    Args:
        source: STEP, BREP, IGES or gmsh's .geo.
        target: The .msh file to write; the .npz file next to it has the skins of the bodies.
        options: Sizes, degree of the elements, symmetry and names.

    Raises:
        InputError: If the file cannot be read, has no bodies, or a body cannot be meshed.
    """
    begin(Stage("reading it"))
    drawing = read_parts(source)
    dim, parts, remarks = drawing.dim, drawing.parts, [*drawing.remarks]
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
    faces, alike = numbered_faces(dim - 1, free, extent, marked)
    names, sets = face_names(dim - 1, parts, faces, alike, options, of_file)
    begin(Stage("meshing", _names_of_faces(dim, parts)))
    longest = mesh_with_areas(dim, parts, options)
    if options.close_gaps and dim == 3:
        straighten(parts, seams)
    missed = max(missed_areas(dim, parts).values(), default=0.0)

    gmsh.model.removePhysicalGroups()
    bodies = [measured_body(dim, part) for part in parts]
    joints = [measured_joint(dim, parts, k, s, shared) for k, s in enumerate(seams, start=1)]
    measured = measured_faces(dim, parts, faces, names, extent)
    named, left_out = measured_sets(dim, parts, faces, sets, seams, of_file)
    np.savez(target.with_suffix(".npz"), **skin_of(dim, parts, faces, measured, seams))
    write_split(target)
    remarks += left_out + [
        f"the worst element of '{body.name}' has quality {body.worst:.1e}: it is nearly flat; a"
        " smaller size, or a geometry without tiny faces, gives a better one"
        for body in bodies
        if body.worst < POOR
    ]
    remarks += [
        f"{' and '.join(map(repr, pair.bodies))} touch only along an edge or at a point: "
        "there is no contact between them"
        for pair in edges
    ]
    remarks += [
        f"'{part.name}' has one element through its thickness in most places, but bending "
        f"needs at least two: give a smaller size (--size-of {part.name}=H)"
        for part in parts
        if share_through(dim, part) > thickness.MOST
    ]
    remarks += apart_remarks([part.name for part in parts], joints)
    if missed > EXACT:
        remarks.append(
            f"areas of faces are up to {100 * missed:.2g} % wrong, since polygons approximate"
            " circles, and so are the forces of pressures on them; more elements around a circle"
            " (--curvature) are more accurate, and total = true keeps the force of a traction"
        )
    nodes = sum(nodes_of(dim, part) for part in parts)
    told = (joints, near, measured, remarks, longest, named)
    return Survey(dim, options.order, nodes, bodies, *told)


def _shared(dim: int, parts: Sequence[Part]) -> set[frozenset[str]]:
    """Return the names of pairs of bodies that share faces in the drawing."""
    return {frozenset(parts[k].name for k in seam.bodies) for seam in find_seams(dim, parts)}


def _names_of_faces(dim: int, parts: Sequence[Part]) -> dict[int, str]:
    """Return the body's name by face; in the plane, by entity of the body."""
    names = {}
    for part in reversed(parts):
        for tag in part.tags:
            faces = [tag] if dim == 2 else gmsh.model.getAdjacencies(dim, tag)[1]
            names.update({int(face): part.name for face in faces})
    return names


def _by_name(dim: int, drawing: Drawing, marked: Mapping[int, Mark]) -> dict[str, set[int]]:
    """Return faces by their names in a script, after bodies have been cut.

    Args:
        dim: Dimension of the faces.
        drawing: The drawing; faces of gmsh's built-in kernel do not change.
        marked: Faces of OpenCASCADE's kernel that coincide with named ones.
    """
    here = {tag for _, tag in gmsh.model.getEntities(dim)}
    made = {tag for _, tag in gmsh.model.occ.getEntities(dim)}
    found = {name: ({*tags} & here) - made for name, tags in drawing.named.items()}
    for tag, mark in marked.items():
        for name in mark.names:
            found[name].add(tag)
    return found
