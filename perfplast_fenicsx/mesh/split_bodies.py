"""Split one conforming gmsh mesh into bodies that share no node, with matching contact surfaces.

Bodies cut from one geometry by ``gmsh.model.occ.fragment`` are meshed together and share the nodes
of their interfaces. :func:`write_split` numbers the nodes of each body separately. The two sides of
an interface then have the same nodes twice, for any geometry, and contact pairs match exactly.
"""

from dataclasses import dataclass
from pathlib import Path

import gmsh
import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.errors import InputError


@dataclass(frozen=True)
class _Part:
    """Elements of one body, or of one side of a surface, in the nodes of the shared mesh.

    Attributes:
        dim: Dimension of the elements.
        body: Tag of the physical volume of the body.
        names: Physical names to write.
        elements: Gmsh element type and node tags, shape (num_elements, nodes_per_element).
    """

    dim: int
    body: int
    names: tuple[str, ...]
    elements: list[tuple[int, npt.NDArray[np.uint64]]]


def write_split(path: str | Path) -> None:
    """Write gmsh's current mesh as a .msh file (version 4.1) whose bodies share no node.

    Each physical volume of the model is a body (in a plane model each physical surface). Parts of
    physical surfaces (curves) that bound one body keep their name. Parts between two bodies are
    written once for each side, as ``BODY_NAME``: the interface ``seam`` of ``lower`` and ``upper``
    becomes ``lower_seam`` and ``upper_seam``. A surface may have several names; groups without a
    name are named by their number. Bodies are also separated along interfaces without a name. The
    function supports first and second order and any kind of element. It is not collective and runs
    on one process.

    Args:
        path: The file to write.

    Raises:
        InputError: If the model has no physical volumes, if a volume is in none of them or in two,
            or if a named surface bounds no body.
    """
    dim = gmsh.model.getDimension()
    bodies = _groups(dim)
    if not bodies:
        raise InputError("the gmsh model has no physical volume; name each body before splitting")
    parts = []
    for entity in _entities(dim):
        own = bodies.get(entity, ())
        if len(own) != 1:
            how = f"in {len(own)} physical volumes" if own else "in no physical volume"
            raise InputError(f"volume {entity} of the gmsh model is {how}; put it in one")
        parts.append(_Part(dim, own[0], (_name(dim, own[0]),), _elements(dim, entity)))
    for entity, groups in _groups(dim - 1).items():
        names = [_name(dim - 1, group) for group in groups]
        adjacent = gmsh.model.getAdjacencies(dim - 1, entity)[0]
        sides = sorted({bodies[int(volume)][0] for volume in adjacent})
        if not sides:
            raise InputError(f"'{names[0]}' is on an entity of the gmsh model that bounds no body")
        for tag in sides:
            body = f"{_name(dim, tag)}_" if len(sides) > 1 else ""
            side = tuple(f"{body}{name}" for name in names)
            parts.append(_Part(dim - 1, tag, side, _elements(dim - 1, entity)))
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    order = np.argsort(tags)
    _write(path, dim, parts, tags[order], coordinates.reshape(-1, 3)[order])


def on_plane(dim: int, axis: int, value: float) -> list[int]:
    """Return tags of the entities of dimension ``dim`` in the plane x_axis = value.

    Args:
        dim: Dimension of the entities.
        axis: 0, 1 or 2.
        value: Position of the plane, with a tolerance of 1e-6 in the model's units.
    """
    lower, upper = np.full(3, -1e9), np.full(3, 1e9)
    lower[axis], upper[axis] = value - 1e-6, value + 1e-6
    return [tag for _, tag in gmsh.model.getEntitiesInBoundingBox(*lower, *upper, dim)]


def _entities(dim: int) -> list[int]:
    return [tag for _, tag in gmsh.model.getEntities(dim)]


def _groups(dim: int) -> dict[int, tuple[int, ...]]:
    """Return the physical tags of each entity that has any."""
    every = {e: gmsh.model.getPhysicalGroupsForEntity(dim, e) for e in _entities(dim)}
    return {entity: tuple(map(int, tags)) for entity, tags in every.items() if len(tags)}


def _name(dim: int, group: int) -> str:
    """Return the name of a physical group, or its number without a name."""
    return str(gmsh.model.getPhysicalName(dim, group)) or str(group)


def _elements(dim: int, entity: int) -> list[tuple[int, npt.NDArray[np.uint64]]]:
    kinds, _, nodes = gmsh.model.mesh.getElements(dim, entity)
    sizes = [gmsh.model.mesh.getElementProperties(kind)[3] for kind in kinds]
    return [
        (int(kind), array.reshape(-1, size))
        for kind, array, size in zip(kinds, nodes, sizes, strict=True)
    ]


def _write(
    path: str | Path,
    dim: int,
    parts: list[_Part],
    tags: npt.NDArray[np.uint64],
    coordinates: Floats,
) -> None:
    """Write the parts as discrete entities of a new model."""
    model = gmsh.model.getCurrent()
    version = gmsh.option.getNumber("Mesh.MshFileVersion")
    gmsh.model.add("split")
    try:
        first = 1
        groups: dict[tuple[int, str], list[int]] = {}
        for body in sorted({part.body for part in parts}):
            mine = [part for part in parts if part.body == body]
            solids = [part for part in mine if part.dim == dim]
            used = np.unique(np.concatenate([n.ravel() for p in solids for _, n in p.elements]))
            points = coordinates[np.searchsorted(tags, used)]
            new = np.arange(first, first + used.size, dtype=np.uint64)
            first += used.size
            for part in mine:
                entity = gmsh.model.addDiscreteEntity(part.dim)
                for name in part.names:
                    groups.setdefault((part.dim, name), []).append(entity)
                if part is solids[0]:
                    gmsh.model.mesh.addNodes(dim, entity, new, points.ravel())
                for kind, nodes in part.elements:
                    renumbered = new[np.searchsorted(used, nodes)].ravel()
                    gmsh.model.mesh.addElementsByType(entity, kind, [], renumbered)
        for (group_dim, name), entities in groups.items():
            gmsh.model.addPhysicalGroup(group_dim, entities, name=name)
        gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
        gmsh.write(str(path))
    finally:
        gmsh.option.setNumber("Mesh.MshFileVersion", version)
        gmsh.model.remove()
        gmsh.model.setCurrent(model)
