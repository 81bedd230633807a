"""A geometry file as a mesh of bodies with names, and a survey of what is in it. One process."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import gmsh
import numpy as np

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.geometry import thickness
from perfplast_fenicsx.geometry.apart import apart_remarks
from perfplast_fenicsx.geometry.cad_measures import worst_area
from perfplast_fenicsx.geometry.closed_gaps import straighten
from perfplast_fenicsx.geometry.face_colours import set_aside, take_back
from perfplast_fenicsx.geometry.face_names import face_names
from perfplast_fenicsx.geometry.free_faces import put_together
from perfplast_fenicsx.geometry.geometry_file import is_script
from perfplast_fenicsx.geometry.joints import box, cut_along_each_other, near_misses
from perfplast_fenicsx.geometry.left_out_bodies import without
from perfplast_fenicsx.geometry.measured import (
    elements,
    measured_body,
    measured_faces,
    measured_joint,
    nodes_of,
    qualities,
)
from perfplast_fenicsx.geometry.meshing_options import MeshingOptions
from perfplast_fenicsx.geometry.parts import Part, read_parts
from perfplast_fenicsx.geometry.progress import Stage, begin
from perfplast_fenicsx.geometry.seams import find_seams, free_faces, take_apart
from perfplast_fenicsx.geometry.sizes import USUAL, Sizes, most_elements
from perfplast_fenicsx.geometry.skin import skin_of
from perfplast_fenicsx.geometry.survey import Survey
from perfplast_fenicsx.geometry.symmetry import cut_in_half
from perfplast_fenicsx.geometry.thickness import share_through
from perfplast_fenicsx.mesh.split_bodies import write_split

NO_VOLUME = 1e-10
"""Elements of less quality have no volume, or a negative one: no run takes them."""

FLAT = 1e-7
"""Elements of less quality are as good as flat, and another algorithm is tried."""

ALGORITHMS = ((6, 1), (6, 10), (1, 1))
"""Gmsh's, of faces and of bodies: frontal Delaunay and Delaunay, which are its defaults; HXT, which
places nodes otherwise; MeshAdapt, which copes with the oddest faces."""


EXACT = 0.01
"""Share by which areas may be wrong without a word."""

POOR = 0.02
"""Elements of less quality are told of."""


def mesh_file(source: Path, target: Path, options: MeshingOptions) -> Survey:
    """Read a geometry file into gmsh's current model, mesh it, and write a .msh and an .npz file.

    Args:
        source: STEP, BREP, IGES or gmsh's .geo.
        target: The .msh file to write; the .npz file beside it has the skins of the bodies.
        options: Sizes, degree of the elements, symmetry and names.

    Raises:
        InputError: If the file cannot be read, has no bodies, or a body cannot be meshed.
    """
    begin(Stage("reading it"))
    dim, parts, remarks = read_parts(source)
    begin(Stage("cutting its bodies along each other"))
    marks = set_aside(parts) if dim == 3 and not is_script(source) else []
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
    colours = take_back(marks, free, parts)
    groups = put_together(dim - 1, free, extent, colours)
    names = face_names(dim - 1, parts, groups, options)
    begin(Stage("meshing", _names_of_faces(dim, parts)))
    longest = _mesh_with_areas(dim, parts, options)
    if options.close_gaps and dim == 3:
        straighten(parts, seams)
    missed = worst_area(dim, parts)

    gmsh.model.removePhysicalGroups()
    bodies = [measured_body(dim, part) for part in parts]
    joints = [measured_joint(dim, parts, k, seam) for k, seam in enumerate(seams, start=1)]
    faces = measured_faces(dim, parts, groups, names, extent)
    np.savez(target.with_suffix(".npz"), **skin_of(dim, parts, groups, faces))
    write_split(target)
    nodes = sum(nodes_of(dim, part) for part in parts)
    remarks += [
        f"the worst element of '{body.name}' has quality {body.worst:.1e}: it is nearly flat; a"
        " smaller size, or a geometry without tiny faces, gives a better one"
        for body in bodies
        if body.worst < POOR
    ]
    remarks += [
        f"{' and '.join(map(repr, pair.bodies))} touch along an edge or at a point alone: there is"
        " no contact between them"
        for pair in edges
    ]
    remarks += [
        f"'{part.name}' has one element through its thickness in most places; bending asks for two"
        f" at least: give a smaller size (--size-of {part.name}=H)"
        for part in parts
        if share_through(dim, part) > thickness.MOST
    ]
    remarks += apart_remarks([part.name for part in parts], joints)
    if missed > EXACT:
        remarks.append(
            f"areas of faces are up to {100 * missed:.2g} % wrong, as circles are polygons, and so"
            " are the forces of pressures on them; more elements about a circle (--curvature) are"
            " nearer, and total = true keeps the force of a traction"
        )
    return Survey(dim, options.order, nodes, bodies, joints, near, faces, remarks, longest)


def _mesh_with_areas(dim: int, parts: Sequence[Part], options: MeshingOptions) -> float:
    """Mesh so finely about circles that areas are right, and say the largest edge length.

    Without a size given it is one of few elements. Where a mesh that is finer
    about circles has flat elements, too many or none at all, the one before is made again.
    """
    most, sizes = most_elements(dim, len(parts)), Sizes.of(dim, parts)
    if options.size is None:
        longest = _usual_size(sizes, options, most)
        options = replace(options, size=longest)
    else:
        longest = _mesh(sizes, options)
    if options.curvature is not None:
        return longest
    before = USUAL
    # Elements about a circle that areas may ask for in turn, as long as the mesh has no more
    # elements than adapted ones may follow.
    thinner = (16.0, 26.0, 36.0)
    # Share of the most elements: adapted meshes know better where to be fine.
    for_areas = 2 / 3
    for finer in thinner:
        if worst_area(dim, parts) <= EXACT:
            break
        try:
            _mesh(sizes, replace(options, curvature=finer))
            few = _count(dim, parts) <= for_areas * most
            fine = few and min(qualities(dim, part).min() for part in parts) >= FLAT
        except InputError:
            fine = False
        if not fine:
            _mesh(sizes, replace(options, curvature=before))
            break
        before = finer
    return longest


def _usual_size(sizes: Sizes, options: MeshingOptions, most: int) -> float:
    """Mesh with a size of the program's own, one that gmsh can mesh with few elements; say which.

    Raises:
        InputError: If no such size can be meshed.
    """
    first = sizes.usual
    # Shares of the usual size that are tried where faces overlap on a coarse mesh.
    finer_sizes = (1.0, 0.7, 0.5)
    for share in finer_sizes:
        size = share * first
        try:
            _mesh(sizes, replace(options, size=size))
        except InputError:
            if share == finer_sizes[-1]:
                raise
            continue
        break
    # Sizes by so much larger are tried, so many times, where small fillets and holes make more
    # elements than the most.
    coarser, times = 1.3, 5
    for _ in range(times if share == 1 else 0):
        if _count(sizes.dim, sizes.parts) <= most:
            break
        try:
            _mesh(sizes, replace(options, size=coarser * size))
        except InputError:
            _mesh(sizes, replace(options, size=size))
            break
        size *= coarser
    return size


def _count(dim: int, parts: Sequence[Part]) -> int:
    """Elements of the mesh."""
    return sum(elements(dim, part).size for part in parts)


def _mesh(sizes: Sizes, options: MeshingOptions) -> float:
    """Mesh, and say the largest edge length."""
    dim, parts = sizes.dim, sizes.parts
    size = sizes.set(options)
    _generate(dim, parts)
    if options.order == 2:
        gmsh.model.mesh.setOrder(2)
        if min(qualities(dim, part).min() for part in parts) < 10 * POOR:
            gmsh.model.mesh.optimize("HighOrderElastic")
        for part in parts:
            if qualities(dim, part).min() <= 0:
                raise InputError(
                    f"curved elements of '{part.name}' fold over; give it a smaller size, or order"
                    " = 1."
                )
    return size


def _generate(dim: int, parts: Sequence[Part]) -> None:
    """Mesh by the first algorithm whose elements are fine, or else by the best of all.

    Raises:
        InputError: Of the first algorithm, if none makes any elements; or if all make flat ones.
    """
    worst: dict[tuple[int, int], dict[str, float]] = {}
    failures = list[InputError]()
    for algorithm in ALGORITHMS:
        try:
            worst[algorithm] = _worst_by(dim, parts, algorithm)
        except InputError as error:
            failures.append(error)
            continue
        if min(worst[algorithm].values()) >= FLAT:
            return
    if not worst:
        raise failures[0]
    best = max(worst, key=lambda one: min(worst[one].values()))
    flat = [name for name, quality in worst[best].items() if quality < NO_VOLUME]
    if flat:
        raise InputError(
            f"{' and '.join(map(repr, flat))} cannot be meshed without elements of no volume, by"
            f" any of {len(ALGORITHMS)} algorithms; remove tiny edges and faces in the CAD system,"
            " or give another size."
        )
    if best != ALGORITHMS[-1]:
        _worst_by(dim, parts, best)


def _worst_by(dim: int, parts: Sequence[Part], algorithm: tuple[int, int]) -> dict[str, float]:
    """Mesh by an algorithm; the quality of the worst element of each body."""
    if any(elements(dim, part).size for part in parts):  # what is not ours may not be cleared
        gmsh.model.mesh.clear()
    for name, number in zip(("Algorithm", "Algorithm3D"), algorithm, strict=True):
        gmsh.option.setNumber(f"Mesh.{name}", number)
    gmsh.option.setNumber("General.AbortOnError", 1)  # an exception would leave gmsh locked
    gmsh.model.mesh.generate(dim)
    gmsh.option.setNumber("General.AbortOnError", 2)
    empty = [
        part
        for part in parts
        if any(not gmsh.model.mesh.getElementTypes(dim, tag).size for tag in part.tags)
    ]
    if empty:
        failed = bool(gmsh.model.mesh.getLastEntityError())
        reason = gmsh.logger.getLastError()
        if not reason or reason.startswith("No elements"):
            reason = "gmsh cannot fill it, mostly as faces of a coarse mesh cross each other"
        fault = _fault(dim, parts if failed else empty[:1], reason)
        kinds = [gmsh.model.getType(*entity) for entity in gmsh.model.getEntities()]
        if not any(kind.startswith("Discrete") for kind in kinds):
            gmsh.model.mesh.clear()  # or the next algorithm would keep the faces' meshes
        raise InputError(fault)
    return {part.name: float(qualities(dim, part).min()) for part in parts}


def _names_of_faces(dim: int, parts: Sequence[Part]) -> dict[int, str]:
    """The body of each face; in the plane, of each body's entity."""
    names = {}
    for part in reversed(parts):
        for tag in part.tags:
            faces = [tag] if dim == 2 else gmsh.model.getAdjacencies(dim, tag)[1]
            names.update({int(face): part.name for face in faces})
    return names


def _fault(dim: int, parts: Sequence[Part], error: str) -> str:
    """What gmsh could not do, with the bodies' names."""
    names = set()
    for part in parts:
        faces = {int(f) for tag in part.tags for f in gmsh.model.getAdjacencies(dim, tag)[1]}
        for entity_dim, tag in gmsh.model.mesh.getLastEntityError():
            if (entity_dim == dim and tag in part.tags) or (entity_dim == dim - 1 and tag in faces):
                names.add(part.name)
    whose = " and ".join(f"'{name}'" for name in sorted(names)) or "the bodies"
    return (
        f"{whose} cannot be meshed: {error.strip().rstrip('.')}; heal the geometry in the CAD"
        " system (tiny faces, faces that cross each other), or give another size."
    )
