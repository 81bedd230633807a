"""What there is in gmsh's current mesh: bodies, where they touch, free faces, with their sizes."""

from collections.abc import Sequence

import gmsh
import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.geometry.cad_measures import cad_measure, mesh_centre, mesh_measure
from perfplast_fenicsx.geometry.face_colours import hex_of, word_of
from perfplast_fenicsx.geometry.free_faces import FaceGroup, round_of, shape_of
from perfplast_fenicsx.geometry.parts import Part
from perfplast_fenicsx.geometry.seams import Seam
from perfplast_fenicsx.geometry.survey import Body, Face, Joint
from perfplast_fenicsx.rounding import ROUNDING


def measured_body(dim: int, part: Part) -> Body:
    """A body, which is a physical group from now on."""
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


def measured_joint(dim: int, parts: Sequence[Part], number: int, seam: Seam) -> Joint:
    """Where two bodies touch: a physical group, or one on each side where they are apart."""
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
    return Joint((one, other), sides, area, shapes)


def measured_faces(
    dim: int, parts: Sequence[Part], groups: Sequence[FaceGroup], names: Sequence[str], size: float
) -> list[Face]:
    """Free faces; those of one name are one physical group."""
    together: dict[str, list[int]] = {}
    faces = []
    for group, name in zip(groups, names, strict=True):
        together.setdefault(name, []).extend(group.tags)
        middle = mesh_centre(dim - 1, group.tags)
        middle[abs(middle) < ROUNDING * size] = 0.0
        area = sum(mesh_measure(dim - 1, tag) for tag in group.tags)
        shape, body = _shape(dim - 1, group), parts[group.body].name
        centre = tuple(float(x) for x in middle)
        several = (group.colour or group.label) and len(group.tags) > 1
        around = "" if several else round_of(dim - 1, group.tags[0])
        known = (cad_measure(dim - 1, group.tags), around)
        faces.append(Face(group.number, name, body, shape, area, centre, *known))
    for name, tags in together.items():
        gmsh.model.addPhysicalGroup(dim - 1, tags, name=name)
    return faces


def _shape(dim: int, group: FaceGroup) -> str:
    """Such as "flat", and the label and colour of faces that have them of their own."""
    shapes = " and ".join(sorted({shape_of(dim, tag) for tag in group.tags}))
    if group.label:
        shapes += f", '{group.label}'"
    if group.colour is None:
        return shapes
    return f"{shapes}, {word_of(group.colour)} {hex_of(group.colour)}"


def elements(dim: int, part: Part) -> npt.NDArray[np.uint64]:
    """The elements of a body."""
    return np.concatenate(
        [np.empty(0, np.uint64)]
        + [tags for tag in part.tags for tags in gmsh.model.mesh.getElements(dim, tag)[1]]
    )


def qualities(dim: int, part: Part) -> Floats:
    """Of the elements of a body, 1 for an equilateral one, 0 for a flat one."""
    return np.asarray(gmsh.model.mesh.getElementQualities(elements(dim, part), "minSICN"))


def nodes_of(dim: int, part: Part) -> int:
    """How many nodes a body has."""
    nodes = [n for tag in part.tags for n in gmsh.model.mesh.getElements(dim, tag)[2]]
    return np.unique(np.concatenate(nodes)).size


def _coordinates(dim: int, tag: int) -> Floats:
    found = gmsh.model.mesh.getNodes(dim, tag, includeBoundary=True, returnParametricCoord=False)
    return np.asarray(found[1]).reshape(-1, 3)
