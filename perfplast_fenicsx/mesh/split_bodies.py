"""Split a conforming gmsh mesh into bodies that share no node, with matching contact surfaces.

Bodies that ``gmsh.model.occ.fragment`` cuts from one geometry are meshed together and share the
nodes on their interfaces. :func:`write_split` numbers the nodes of each body separately. The two
sides of an interface therefore have separate nodes at the same points, for any geometry, and
contact pairs match exactly.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import gmsh
import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.errors import InputError

Tags = npt.NDArray[np.uint64]

TRIANGLES = {2: ((0, 1), (1, 2), (2, 0)), 9: ((0, 1, 3), (1, 2, 4), (2, 0, 5))}
"""Local nodes of the edges of gmsh's triangles of first and second order, by element type."""


@dataclass(frozen=True)
class _Part:
    """Elements of one body, or of one side of a surface, with nodes of the conforming mesh.

    Attributes:
        dim: Dimension of the elements.
        body: Tag of the physical volume of the body.
        names: Names of the physical groups to write.
        elements: Gmsh's element types with node tags, shape (num_elements, nodes_per_element).
    """

    dim: int
    body: int
    names: tuple[str, ...]
    elements: list[tuple[int, npt.NDArray[np.uint64]]]


def write_split(path: str | Path, cracks: Sequence[tuple[str, str]] = ()) -> None:
    """Write gmsh's current mesh as a .msh file (version 4.1) in which bodies share no node.

    Each physical volume (in a plane model each physical surface) is a body. Parts of physical
    surfaces (in a plane model curves) that bound one body keep their name. Parts between two bodies
    are written once for each side, as ``BODY_NAME``: the interface ``seam`` of ``lower`` and
    ``upper`` becomes ``lower_seam`` and ``upper_seam``. A surface may have several names; groups
    without a name have their number as name. Bodies are also separated along interfaces without a
    name. The function supports elements of any kind, of first and second order. The function is
    not collective and runs on one process.

    Open cracks are curves inside plane bodies. Their nodes are doubled, except at crack tips inside
    the body.

    Args:
        path: The file to write.
        cracks: Names of both sides of each open crack. The physical groups of both names contain
            the same curves. The first name is for the side on the left, seen along the curves.

    Raises:
        InputError: If the model has no physical volume, if a volume is in no physical volume or in
            two of them, or if a named surface bounds no body.
    """
    dim = gmsh.model.getDimension()
    bodies = _groups(dim)
    if not bodies:
        raise InputError("the gmsh model has no physical volume; name each body before splitting.")
    parts, slits = [], list[_Part]()
    for entity in _entities(dim):
        own = bodies.get(entity, ())
        if len(own) != 1:
            how = f"in {len(own)} physical volumes" if own else "in no physical volume"
            raise InputError(
                f"volume {entity} of the gmsh model is {how}; put it in exactly one physical "
                "volume."
            )
        parts.append(_Part(dim, own[0], (_name(dim, own[0]),), _elements(dim, entity)))
    for entity, groups in _groups(dim - 1).items():
        names = [_name(dim - 1, group) for group in groups]
        if both := [crack for crack in cracks if {*crack} <= {*names}]:
            slits.append(_Part(1, 0, both[0], _elements(1, entity)))
            continue
        adjacent = gmsh.model.getAdjacencies(dim - 1, entity)[0]
        sides = sorted({bodies[int(volume)][0] for volume in adjacent})
        if not sides:
            raise InputError(
                f"'{names[0]}' names an entity that bounds no body in the gmsh model; remove the "
                "name, or name a surface of a body."
            )
        for tag in sides:
            body = f"{_name(dim, tag)}_" if len(sides) > 1 else ""
            side = tuple(f"{body}{name}" for name in names)
            parts.append(_Part(dim - 1, tag, side, _elements(dim - 1, entity)))
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    order = np.argsort(tags)
    tags, coordinates = tags[order], coordinates.reshape(-1, 3)[order]
    if slits:
        parts, tags, coordinates = _opened(parts, slits, tags, coordinates)
    _write(path, dim, parts, tags, coordinates)


def on_plane(dim: int, axis: int, value: float) -> list[int]:
    """Return the tags of the entities of dimension ``dim`` in the plane x_axis = value.

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
    """Return, for each entity of dimension ``dim`` in a physical group, the tags of its groups."""
    every = {e: gmsh.model.getPhysicalGroupsForEntity(dim, e) for e in _entities(dim)}
    return {entity: tuple(map(int, tags)) for entity, tags in every.items() if len(tags)}


def _name(dim: int, group: int) -> str:
    """Return the name of a physical group; its number if it has no name."""
    return str(gmsh.model.getPhysicalName(dim, group)) or str(group)


def _elements(dim: int, entity: int) -> list[tuple[int, npt.NDArray[np.uint64]]]:
    kinds, _, nodes = gmsh.model.mesh.getElements(dim, entity)
    sizes = [gmsh.model.mesh.getElementProperties(kind)[3] for kind in kinds]
    return [
        (int(kind), array.reshape(-1, size))
        for kind, array, size in zip(kinds, nodes, sizes, strict=True)
    ]


def _opened(
    parts: list[_Part], slits: list[_Part], tags: Tags, coordinates: Floats
) -> tuple[list[_Part], Tags, Floats]:
    """Return parts, node tags and coordinates after doubling the nodes of cracks.

    Args:
        parts: Bodies and parts of their boundaries.
        slits: Curves of cracks with the names of both sides, the left side first.
        tags: Tags of the nodes, sorted.
        coordinates: Coordinates of the nodes, shape (num_nodes, 3).

    Raises:
        InputError: If the bodies have other elements than triangles of one order.
    """
    kinds = {kind for part in parts if part.dim == 2 for kind, _ in part.elements}
    if len(kinds) != 1 or not kinds <= TRIANGLES.keys():
        raise InputError(
            "open cracks inside a body need a mesh that has only triangles of one "
            "order; mesh the bodies with such triangles."
        )
    local = np.array(TRIANGLES[kinds.pop()])
    found = list[_Part]()
    for body in sorted({part.body for part in parts}):
        solids = [part for part in parts if part.body == body and part.dim == 2]
        rest = [part for part in parts if part.body == body and part.dim == 1]
        cells = np.concatenate([nodes for part in solids for _, nodes in part.elements])
        keys = _keys(cells[:, local].reshape(-1, len(local[0])))
        own = [it for it in slits if np.isin(_keys(it.elements[0][1]), keys).any()]
        if not own:
            found += [*solids, *rest]
            continue
        cut = np.concatenate([nodes for it in own for _, nodes in it.elements])
        opened, copied = _doubled(cells, local, cut, int(tags[-1]) + 1)
        places = coordinates[np.searchsorted(tags, cells)][..., :2]
        beside = _Beside(cells, opened, places, local)
        found.append(_Part(2, body, solids[0].names, [(solids[0].elements[0][0], opened)]))
        for part in rest:
            moved = [(kind, beside.of(nodes)[0]) for kind, nodes in part.elements]
            found.append(replace(part, elements=moved))
        for it in own:
            on = [(kind, beside.of(nodes)) for kind, nodes in it.elements]
            for side, name in enumerate(it.names):
                some = [(kind, both[side]) for kind, both in on]
                found.append(_Part(1, body, (name,), some))
        coordinates = np.concatenate([coordinates, coordinates[np.searchsorted(tags, copied)]])
        more = int(tags[-1]) + 1 + np.arange(len(copied))
        tags = np.concatenate([tags, more.astype(tags.dtype)])
    return found, tags, coordinates


def _doubled(cells: Tags, local: Longs, cut: Tags, first: int) -> tuple[Tags, Tags]:
    """Return cells with copied nodes at a crack, and the original node of each copy.

    At a node of the crack, cells that are connected across edges outside the crack share one node.
    Each further group of connected cells around the node gets a copy.

    Args:
        cells: Nodes of the triangles, shape (num_cells, k).
        local: Local nodes of the triangles' edges, ends first, shape (3, e).
        cut: Nodes of the crack's edges, shape (num_edges, e).
        first: Tag of the first copy.
    """
    size = local.shape[1]
    corners = np.arange(cells.size).reshape(cells.shape)[:, local].reshape(-1, size)
    keys = _keys(cells[:, local].reshape(-1, size))
    order = np.argsort(keys, kind="stable")
    keys = keys[order]
    met = (keys[1:] == keys[:-1]) & ~np.isin(keys[1:], _keys(cut))
    one, other = corners[order[:-1]][met], corners[order[1:]][met]
    nodes = cells.ravel()
    turned = nodes[one[:, 0]] != nodes[other[:, 0]]
    other[turned, :2] = other[turned][:, [1, 0]]
    links = coo_array((np.ones(one.size), (one.ravel(), other.ravel())), shape=(cells.size,) * 2)
    _, group = connected_components(links, directed=False)
    pairs = np.column_stack([nodes.astype(np.int64), np.where(np.isin(nodes, cut), group, -1)])
    kinds, number = np.unique(pairs, axis=0, return_inverse=True)
    again = np.append(False, kinds[1:, 0] == kinds[:-1, 0])
    new = kinds[:, 0].astype(cells.dtype)
    new[again] = first + np.arange(again.sum())
    return new[number.ravel()].reshape(cells.shape), kinds[again, 0].astype(cells.dtype)


class _Beside:
    """Find the nodes that edges have in the cells on both sides."""

    def __init__(self, cells: Tags, opened: Tags, places: Floats, local: Longs) -> None:
        """Sort the edges of all cells.

        Args:
            cells: Nodes of the triangles, shape (num_cells, k).
            opened: The same triangles with copied nodes.
            places: Coordinates of the nodes, shape (num_cells, k, 2).
            local: Local nodes of the edges, ends first, shape (3, e).
        """
        size = local.shape[1]
        self._edges, self._opened = (it[:, local].reshape(-1, size) for it in (cells, opened))
        keys = _keys(self._edges)
        self._order = np.argsort(keys, kind="stable")
        self._keys = keys[self._order]
        self._ends = places[:, local[:, :2]].reshape(-1, 2, 2)
        self._middles = np.repeat(places[:, :3].mean(axis=1), len(local), axis=0)

    def of(self, edges: Tags) -> tuple[Tags, Tags]:
        """Return the nodes that edges have in the cell on the left and in the cell on the right.

        Args:
            edges: Nodes of the edges, shape (n, e); a boundary edge has the same cell on both
                sides.
        """
        keys = _keys(edges)
        at = [
            self._order[np.searchsorted(self._keys, keys)],
            self._order[np.searchsorted(self._keys, keys, "right") - 1],
        ]
        forward = [self._edges[k][:, 0] == edges[:, 0] for k in at]
        ends = np.where(forward[0][:, None, None], self._ends[at[0]], self._ends[at[0]][:, ::-1])
        along, over = ends[:, 1] - ends[:, 0], self._middles[at[0]] - ends[:, 0]
        is_left = (along[:, 0] * over[:, 1] - along[:, 1] * over[:, 0] > 0)[:, None]
        one, other = (
            np.column_stack([np.where(f[:, None], new[:, :2], new[:, 1::-1]), new[:, 2:]])
            for f, new in zip(forward, (self._opened[k] for k in at), strict=True)
        )
        return np.where(is_left, one, other), np.where(is_left, other, one)


def _keys(edges: Tags) -> Longs:
    """Return a number for each edge that depends only on its ends, not on its direction."""
    ends = np.sort(edges[:, :2].astype(np.int64), axis=1)
    return np.asarray(ends[:, 0] * (1 << 31) + ends[:, 1])


def _write(
    path: str | Path,
    dim: int,
    parts: list[_Part],
    tags: Tags,
    coordinates: Floats,
) -> None:
    """Write a .msh file with the parts as discrete entities of a new gmsh model."""
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
