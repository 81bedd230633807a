"""Name entities of gmsh's current model: the physical groups that the program reads."""

from collections.abc import Iterable, Mapping

import gmsh

from perfplast_fenicsx.mesh import on_plane


def name(dim: int, groups: Mapping[str, Iterable[int]]) -> None:
    """Name the entities of one dimension.

    Args:
        dim: Dimension of the entities.
        groups: Tags of the entities by name.
    """
    for label, tags in groups.items():
        gmsh.model.addPhysicalGroup(dim, list(tags), name=label)


def name_planes(dim: int, planes: Mapping[str, tuple[int, float]]) -> None:
    """Name the entities that lie in planes x_axis = value.

    Args:
        dim: Dimension of the entities.
        planes: Axis and value by name.
    """
    name(dim, {label: on_plane(dim, *plane) for label, plane in planes.items()})


def interface(dim: int) -> list[int]:
    """Return the tags of the entities of dimension ``dim`` that two bodies share."""
    entities = [tag for _, tag in gmsh.model.getEntities(dim)]
    return [tag for tag in entities if len(gmsh.model.getAdjacencies(dim, tag)[0]) == 2]


def on_diagonal() -> list[int]:
    """Return the tags of the faces whose middles lie on the plane x = y."""
    faces = [tag for _, tag in gmsh.model.getEntities(2)]
    middles = [gmsh.model.occ.getCenterOfMass(2, tag) for tag in faces]
    rounding = 1e-9
    return [tag for tag, (x, y, _) in zip(faces, middles, strict=True) if abs(x - y) < rounding]
