"""Mesh the bodies of gmsh's current model one by one, so that their nodes do not match."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import gmsh
import numpy as np
import numpy.typing as npt

from meshes.naming import name
from perfplast_fenicsx.mesh import write_split

Elements = list[tuple[int, npt.NDArray[np.uint64]]]
"""Gmsh's types of elements, each with the nodes of all its elements in a single array."""


@dataclass(frozen=True)
class MeshedBody:
    """The mesh of one body.

    Attributes:
        name: Name of the body.
        tags: Tags of its nodes in ascending order, shape (n,).
        points: Coordinates of these nodes, shape (n, 3).
        solid: Elements of the body.
        surfaces: Elements of its named surfaces.
    """

    name: str
    tags: npt.NDArray[np.uint64]
    points: npt.NDArray[np.float64]
    solid: Elements
    surfaces: dict[str, Elements]


def write_apart(path: str | Path, generate: Callable[[str], None]) -> None:
    """Mesh each named body separately, and write all bodies as ``write_split`` does.

    Args:
        path: The file to write.
        generate: Function that meshes the visible part of gmsh's current model; its argument is the
            body's name.
    """
    model = gmsh.model
    dim = model.getDimension()
    gmsh.option.setNumber("Mesh.MeshOnlyVisible", 1)
    bodies = []
    for group in model.getPhysicalGroups(dim):
        body = model.getPhysicalName(*group)
        model.mesh.clear()
        model.setVisibility(model.getEntities(), 0)
        solids = [(dim, tag) for tag in model.getEntitiesForPhysicalGroup(*group)]
        model.setVisibility(solids, 1, recursive=True)
        generate(body)
        bodies.append(meshed_body(body))
    write_bodies(path, bodies)


def meshed_body(body: str) -> MeshedBody:
    """Return the mesh of a body in gmsh's current model."""
    model = gmsh.model
    dim = model.getDimension()
    groups = {model.getPhysicalName(*group): group for group in model.getPhysicalGroups(dim)}
    owner = {
        int(tag): label
        for label, group in groups.items()
        for tag in model.getEntitiesForPhysicalGroup(*group)
    }
    solid = [part for tag, label in owner.items() if label == body for part in _elements(dim, tag)]
    surfaces: dict[str, Elements] = {}
    for group in model.getPhysicalGroups(dim - 1):
        for tag in model.getEntitiesForPhysicalGroup(*group):
            sides = {owner[int(other)] for other in model.getAdjacencies(dim - 1, tag)[0]}
            if body in sides:
                label = model.getPhysicalName(*group)
                side = label if len(sides) == 1 else f"{body}_{label}"
                surfaces.setdefault(side, []).extend(_elements(dim - 1, tag))
    tags, coordinates, _ = model.mesh.getNodes()
    used = np.isin(tags, np.concatenate([nodes for _, nodes in solid]))
    order = np.argsort(tags[used])
    points = coordinates.reshape(-1, 3)[used]
    return MeshedBody(body, tags[used][order], points[order], solid, surfaces)


def write_bodies(path: str | Path, bodies: Sequence[MeshedBody]) -> None:
    """Write bodies without common nodes as one .msh file."""
    model = gmsh.model
    gmsh.model.add("apart")
    first = 1
    groups: dict[tuple[int, str], list[int]] = {}
    for body in bodies:
        dim = gmsh.model.mesh.getElementProperties(body.solid[0][0])[1]
        faces = {label: model.addDiscreteEntity(dim - 1) for label in body.surfaces}
        solid = model.addDiscreteEntity(dim, boundary=list(faces.values()))
        new = np.arange(first, first + len(body.tags), dtype=np.uint64)
        first += len(new)
        model.mesh.addNodes(dim, solid, new, body.points.ravel())
        entities = [(solid, body.solid)]
        entities += [(face, body.surfaces[label]) for label, face in faces.items()]
        for entity, elements in entities:
            for kind, nodes in elements:
                renumbered = new[np.searchsorted(body.tags, nodes)]
                model.mesh.addElementsByType(entity, kind, [], renumbered)
        groups[dim, body.name] = [solid]
        for label, face in faces.items():
            groups.setdefault((dim - 1, label), []).append(face)
    for (dim, label), entities_of in groups.items():
        name(dim, {label: entities_of})
    write_split(path)
    model.remove()


def _elements(dim: int, tag: int) -> Elements:
    kinds, _, nodes = gmsh.model.mesh.getElements(dim, tag)
    return list(zip(map(int, kinds), nodes, strict=True))
