"""A geometry file as a mesh of bodies with names, and a survey of what is in it. One process."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import gmsh
import numpy as np

from perfplast_fenicsx.errors import InputError, nearest
from perfplast_fenicsx.geometry import thickness
from perfplast_fenicsx.geometry.cad_measures import worst_area
from perfplast_fenicsx.geometry.face_colours import set_aside, take_back
from perfplast_fenicsx.geometry.face_names import face_names
from perfplast_fenicsx.geometry.free_faces import put_together
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
from perfplast_fenicsx.geometry.parts import Part, is_script, read_parts
from perfplast_fenicsx.geometry.progress import Stage, begin
from perfplast_fenicsx.geometry.seams import find_seams, free_faces, take_apart
from perfplast_fenicsx.geometry.skin import skin_of
from perfplast_fenicsx.geometry.survey import Survey
from perfplast_fenicsx.geometry.symmetry import cut_in_half
from perfplast_fenicsx.geometry.thickness import share_through
from perfplast_fenicsx.mesh.split_bodies import write_split

ELEMENTS = 15_000
"""About so many a mesh has without a size given."""

NO_VOLUME = 1e-10
"""Elements of less quality have no volume, or a negative one: no run takes them."""

FLAT = 1e-7
"""Elements of less quality are as good as flat, and another algorithm is tried."""

ALGORITHMS = ((6, 1), (6, 10), (1, 1))
"""Gmsh's, of faces and of bodies: frontal Delaunay and Delaunay, which are its defaults; HXT, which
places nodes otherwise; MeshAdapt, which copes with the oddest faces."""

USUAL, FINER = 10.0, (16.0, 26.0, 36.0)
"""Elements about a circle where nothing is said, and those that areas may ask for in turn, as long
as the mesh has no more than twice :data:`ELEMENTS`."""

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
    dim, parts = read_parts(source)
    begin(Stage("cutting its bodies along each other"))
    marks = set_aside(parts) if dim == 3 and not is_script(source) else []
    parts = without(dim, parts, options.without)
    parts = cut_in_half(dim, parts, options.symmetry)
    parts = cut_along_each_other(dim, parts, options.overlap)
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
    missed = worst_area(dim, parts)

    gmsh.model.removePhysicalGroups()
    bodies = [measured_body(dim, part) for part in parts]
    joints = [measured_joint(dim, parts, k, seam) for k, seam in enumerate(seams, start=1)]
    faces = measured_faces(dim, parts, groups, names, extent)
    np.savez(target.with_suffix(".npz"), **skin_of(dim, parts, groups, faces))
    write_split(target)
    nodes = sum(nodes_of(dim, part) for part in parts)
    remarks = [
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
    if missed > EXACT:
        remarks.append(
            f"areas of faces are up to {100 * missed:.2g} % wrong, as circles are polygons, and so"
            " are the forces of pressures on them; more elements about a circle (--curvature) are"
            " nearer, and total = true keeps the force of a traction"
        )
    return Survey(dim, options.order, nodes, bodies, joints, near, faces, remarks, longest)


def _mesh_with_areas(dim: int, parts: Sequence[Part], options: MeshingOptions) -> float:
    """Mesh so finely about circles that areas are right, and say the largest edge length.

    Where a finer mesh has flat elements, too many or none at all, the one before is made again.
    """
    longest = _mesh(dim, parts, options)
    if options.curvature is not None:
        return longest
    before = USUAL
    for finer in FINER:
        if worst_area(dim, parts) <= EXACT:
            break
        try:
            _mesh(dim, parts, replace(options, curvature=finer))
            few = sum(elements(dim, part).size for part in parts) <= 2 * ELEMENTS
            fine = few and min(qualities(dim, part).min() for part in parts) >= FLAT
        except InputError:
            fine = False
        if not fine:
            _mesh(dim, parts, replace(options, curvature=before))
            break
        before = finer
    return longest


def _mesh(dim: int, parts: Sequence[Part], options: MeshingOptions) -> float:
    """Mesh, and say the largest edge length."""
    boxes = {part.name: box(dim, part.tags) for part in parts}
    for body in options.sizes:
        if body not in boxes:
            raise InputError(
                f"sizes names '{body}', but there is no such body; {nearest(body, boxes)}"
            )
    lengths = [np.sort(around[1] - around[0])[-dim:] for around in boxes.values()]
    room = sum(float(np.prod(np.maximum(length, 1e-12))) for length in lengths)
    size = options.size or float(room / (ELEMENTS / (6 if dim == 3 else 2))) ** (1 / dim)
    curvature = USUAL if options.curvature is None else options.curvature
    for name, value in (("FromCurvature", curvature), ("ExtendFromBoundary", 1)):
        gmsh.option.setNumber(f"Mesh.MeshSize{name}", value)
    gmsh.option.setNumber("Mesh.MeshSizeMax", max([size, *options.sizes.values()]))
    _without_size(max([size, *options.sizes.values()]))
    _sizes_by_body(dim, parts, options.sizes, size)
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
    """Mesh by the first algorithm whose elements are fine, or else by the best of all."""
    worst: dict[tuple[int, int], dict[str, float]] = {}
    for algorithm in ALGORITHMS:
        worst[algorithm] = _worst_by(dim, parts, algorithm)
        if min(worst[algorithm].values()) >= FLAT:
            return
    best = max(ALGORITHMS, key=lambda one: min(worst[one].values()))
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
    try:
        gmsh.model.mesh.generate(dim)
    except Exception as error:  # gmsh raises nothing more specific
        raise InputError(_fault(dim, parts, str(error))) from error
    for part in parts:
        if not elements(dim, part).size:
            reason = gmsh.logger.getLastError() or "gmsh made no elements"
            raise InputError(_fault(dim, [part], reason))
    return {part.name: float(qualities(dim, part).min()) for part in parts}


def _names_of_faces(dim: int, parts: Sequence[Part]) -> dict[int, str]:
    """The body of each face; in the plane, of each body's entity."""
    names = {}
    for part in reversed(parts):
        for tag in part.tags:
            faces = [tag] if dim == 2 else gmsh.model.getAdjacencies(dim, tag)[1]
            names.update({int(face): part.name for face in faces})
    return names


def _without_size(size: float) -> None:
    """Give points a size that have none; gmsh would take a tenth of the model's diagonal."""
    points = gmsh.model.getEntities(0)
    given = gmsh.model.mesh.getSizes(points)
    gmsh.model.mesh.setSize([p for p, h in zip(points, given, strict=True) if h == 0], size)


def _sizes_by_body(
    dim: int, parts: Sequence[Part], sizes: dict[str, float], elsewhere: float
) -> None:
    """Bodies of sizes of their own, the smaller one where two meet."""
    if not sizes:
        return
    fields = []
    for part in parts:
        one = gmsh.model.mesh.field.add("Constant")
        gmsh.model.mesh.field.setNumber(one, "VIn", sizes.get(part.name, elsewhere))
        gmsh.model.mesh.field.setNumber(one, "VOut", 1e22)
        where = {3: "VolumesList", 2: "SurfacesList"}[dim]
        gmsh.model.mesh.field.setNumbers(one, where, part.tags)
        fields.append(one)
    least = gmsh.model.mesh.field.add("Min")
    gmsh.model.mesh.field.setNumbers(least, "FieldsList", fields)
    gmsh.model.mesh.field.setAsBackgroundMesh(least)


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
