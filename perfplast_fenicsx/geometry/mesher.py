"""A geometry file as a mesh of bodies with names, and a survey of what is in it. One process."""

from collections.abc import Sequence
from pathlib import Path

import gmsh
import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.errors import InputError, nearest
from perfplast_fenicsx.geometry.free_faces import name_of, put_together, shape_of
from perfplast_fenicsx.geometry.joints import box, cut_along_each_other, near_misses, shared
from perfplast_fenicsx.geometry.meshing_options import MeshingOptions
from perfplast_fenicsx.geometry.parts import Part, read_parts
from perfplast_fenicsx.geometry.skin import skin_of
from perfplast_fenicsx.geometry.survey import Body, Face, Joint, Survey
from perfplast_fenicsx.mesh.split_bodies import write_split

ELEMENTS = 15_000
"""About so many a mesh has without a size given."""

ROUNDING = 1e-9
"""Coordinates below this share of a body's size are zero."""

GAUSS = "Gauss4"
"""Rule that volumes of curved elements are exact with."""

POOR = 0.02
"""Elements of less quality are told of."""


def mesh_file(source: Path, target: Path, options: MeshingOptions) -> Survey:
    """Read a geometry file into gmsh's current model, mesh it, and write a .msh and an .npz file.

    Args:
        source: STEP, BREP, IGES or gmsh's .geo.
        target: The .msh file to write; the .npz file beside it has the skins of the bodies.
        options: Sizes and degree of the elements.

    Raises:
        InputError: If the file cannot be read, has no bodies, or a body cannot be meshed.
    """
    dim, parts = read_parts(source)
    parts = cut_along_each_other(dim, parts, options.overlap)
    near = near_misses(dim, parts)
    _mesh(dim, parts, options)

    owner = {tag: number for number, part in enumerate(parts) for tag in part.tags}
    sides = shared(dim, owner)
    bodies = [_body(dim, part) for part in parts]
    gmsh.model.removePhysicalGroups()
    for part in parts:
        gmsh.model.addPhysicalGroup(dim, part.tags, name=part.name)
    joints = _joints(dim, parts, sides)
    faces = _faces(dim, parts, sides)
    np.savez(target.with_suffix(".npz"), **skin_of(dim, bodies, faces))
    write_split(target)
    nodes = sum(_nodes_of(dim, part) for part in parts)
    remarks = [
        f"the worst element of '{body.name}' has quality {body.worst:.1e}: it is nearly flat; a"
        " smaller size, or a geometry without tiny faces, gives a better one"
        for body in bodies
        if body.worst < POOR
    ]
    return Survey(dim, options.order, nodes, bodies, joints, near, faces, remarks)


def _mesh(dim: int, parts: Sequence[Part], options: MeshingOptions) -> None:
    boxes = {part.name: box(dim, part.tags) for part in parts}
    for body in options.sizes:
        if body not in boxes:
            raise InputError(
                f"sizes names '{body}', but there is no such body; {nearest(body, boxes)}"
            )
    lengths = [np.sort(around[1] - around[0])[-dim:] for around in boxes.values()]
    room = sum(float(np.prod(np.maximum(length, 1e-12))) for length in lengths)
    size = options.size or (room / (ELEMENTS / (6 if dim == 3 else 2))) ** (1 / dim)
    for name, value in (("FromCurvature", options.curvature), ("ExtendFromBoundary", 1)):
        gmsh.option.setNumber(f"Mesh.MeshSize{name}", value)
    gmsh.option.setNumber("Mesh.MeshSizeMax", max([size, *options.sizes.values()]))
    _sizes_by_body(dim, parts, options.sizes, size)
    try:
        gmsh.model.mesh.generate(dim)
    except Exception as error:  # gmsh raises nothing more specific
        raise InputError(_fault(dim, parts, str(error))) from error
    if gmsh.logger.getLastError() and not _elements(dim, parts[-1]).size:
        raise InputError(_fault(dim, parts, gmsh.logger.getLastError()))
    if options.order == 2:
        gmsh.model.mesh.setOrder(2)
        if min(_qualities(dim, part).min() for part in parts) < 10 * POOR:
            gmsh.model.mesh.optimize("HighOrderElastic")
        for part in parts:
            if _qualities(dim, part).min() <= 0:
                raise InputError(
                    f"curved elements of '{part.name}' fold over; give it a smaller size, or order"
                    " = 1."
                )


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


def _body(dim: int, part: Part) -> Body:
    tags = _elements(dim, part)
    points = np.concatenate([_coordinates(dim, tag) for tag in part.tags])
    return Body(
        name=part.name,
        label=part.label,
        volume=sum(_measure(dim, tag) for tag in part.tags),
        low=tuple(points.min(axis=0).tolist()),
        high=tuple(points.max(axis=0).tolist()),
        cells=tags.size,
        worst=float(_qualities(dim, part).min()),
    )


def _joints(dim: int, parts: Sequence[Part], sides: dict[int, tuple[int, ...]]) -> list[Joint]:
    """Name what two bodies share, and measure it."""
    pairs: dict[tuple[int, ...], list[int]] = {}
    for face, bodies in sides.items():
        if len(bodies) == 2:
            pairs.setdefault(bodies, []).append(face)
    joints = []
    for number, (bodies, faces) in enumerate(sorted(pairs.items()), start=1):
        name = f"joint_{number}"
        gmsh.model.addPhysicalGroup(dim - 1, faces, name=name)
        one, other = (parts[body].name for body in bodies)
        shapes = tuple(sorted({shape_of(dim - 1, face) for face in faces}))
        area = sum(_measure(dim - 1, face) for face in faces)
        joints.append(Joint((one, other), (f"{one}_{name}", f"{other}_{name}"), area, shapes))
    return joints


def _faces(dim: int, parts: Sequence[Part], sides: dict[int, tuple[int, ...]]) -> list[Face]:
    """Name what is free, and measure it."""
    free = {face: own[0] for face, own in sides.items() if len(own) == 1}
    around = [box(dim, part.tags) for part in parts]
    size = max(float(np.linalg.norm(high - low)) for low, high in around)
    groups = sorted(put_together(dim - 1, free, size), key=lambda group: group[0])
    faces, used = [], set()
    for number, (body, tags) in enumerate(groups, start=1):
        name = name_of(parts[body].name, number, dim - 1, tags, around[body])
        if name in used:
            name = f"{parts[body].name}_face_{number}"
        used.add(name)
        gmsh.model.addPhysicalGroup(dim - 1, tags, name=name)
        nodes = np.concatenate([_coordinates(dim - 1, tag) for tag in tags])
        shape, area = shape_of(dim - 1, tags[0]), sum(_measure(dim - 1, tag) for tag in tags)
        middle = nodes.mean(axis=0)
        middle[abs(middle) < ROUNDING * size] = 0.0
        faces.append(Face(number, name, parts[body].name, shape, area, tuple(map(float, middle))))
    return faces


def _elements(dim: int, part: Part) -> npt.NDArray[np.uint64]:
    found = [tags for tag in part.tags for tags in gmsh.model.mesh.getElements(dim, tag)[1]]
    if not found:
        raise InputError(_fault(dim, [part], gmsh.logger.getLastError() or "gmsh made no elements"))
    return np.concatenate(found)


def _qualities(dim: int, part: Part) -> Floats:
    return np.asarray(gmsh.model.mesh.getElementQualities(_elements(dim, part), "minSICN"))


def _measure(dim: int, tag: int) -> float:
    """Volume, area or length of the elements, curved ones too."""
    total = 0.0
    for kind in gmsh.model.mesh.getElementTypes(dim, tag):
        points, weights = gmsh.model.mesh.getIntegrationPoints(kind, GAUSS)
        determinants = gmsh.model.mesh.getJacobians(kind, points, tag)[1]
        total += float((determinants.reshape(-1, weights.size) @ weights).sum())
    return total


def _coordinates(dim: int, tag: int) -> Floats:
    found = gmsh.model.mesh.getNodes(dim, tag, includeBoundary=True, returnParametricCoord=False)
    return np.asarray(found[1]).reshape(-1, 3)


def _nodes_of(dim: int, part: Part) -> int:
    nodes = [n for tag in part.tags for n in gmsh.model.mesh.getElements(dim, tag)[2]]
    return np.unique(np.concatenate(nodes)).size
