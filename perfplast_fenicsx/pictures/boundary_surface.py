"""Extract the skin of the bodies from the arrays of a mesh. Single-process.

The skin of a plane mesh is the mesh itself; its exterior facets are the boundary edges.
"""

from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.io.case.scene import NamedScene


@dataclass(frozen=True)
class Surface:
    """Triangles of a skin, with values at points and triangles.

    Attributes:
        points: Undeformed points, shape (num_points, 3).
        triangles: Indices of points, in 3D counterclockwise seen from outside, shape
            (num_triangles, 3).
        edges: Exterior edges of a plane mesh as indices of points; the body is on the left of each
            edge; shape (num_edges, 2). Empty in 3D.
        body: Index in ``names`` of each triangle's volume, shape (num_triangles,).
        names: Names of the volumes, in the order of their tags.
        at_points: Nodal values by name, shape (num_points,) or (num_points, 3).
        at_cells: Values of the triangles' cells by name, shape (num_triangles,).
        marks: Whether each of :attr:`facets` lies on a marked surface, by name of the mark.
    """

    points: Floats
    triangles: Longs
    edges: Longs
    body: Longs
    names: list[str]
    at_points: dict[str, Floats]
    at_cells: dict[str, Floats]
    marks: dict[str, npt.NDArray[np.bool_]]

    def __repr__(self) -> str:
        return f"Surface({', '.join(self.names)}; {len(self.triangles)} triangles)"

    @property
    def plane(self) -> bool:
        """Return whether the mesh is plane."""
        return len(self.edges) > 0

    @property
    def facets(self) -> Longs:
        """Return the facets on which loads and contact act: triangles in 3D, edges in the plane."""
        return self.edges if self.plane else self.triangles

    @property
    def normals(self) -> Floats:
        """Return outward normals of the facets, shape (n, 3); their norms are areas or lengths."""
        return _normals(self.points, self.facets)

    @property
    def areas(self) -> Floats:
        """Return the areas of the triangles."""
        return np.asarray(np.linalg.norm(_normals(self.points, self.triangles), axis=1))

    @property
    def size(self) -> float:
        """Return the diagonal of the bounding box (length)."""
        return float(np.linalg.norm(np.ptp(self.points, axis=0)))


@dataclass(frozen=True)
class Skin:
    """A surface without fields, and the sources of its values in the mesh.

    Attributes:
        surface: The surface.
        nodes: Mesh node of each point, shape (num_points,).
        cells: Mesh cell of each triangle, shape (num_triangles,).
        tags: Tag of the surface on which each facet lies, −1 for no surface, shape (num_facets,).
    """

    surface: Surface
    nodes: Longs
    cells: Longs
    tags: Longs


def make_skin(
    x: Floats,
    cells: npt.NDArray[np.integer[Any]],
    body: npt.NDArray[np.integer[Any]],
    tagged: npt.NDArray[np.integer[Any]],
    tags: npt.NDArray[np.integer[Any]],
    named: NamedScene,
) -> Skin:
    """Return the skin of a mesh.

    Args:
        x: Coordinates of the nodes, shape (num_nodes, 2 or 3).
        cells: Nodes of triangles or tetrahedra, vertices first, shape (num_cells, nodes_per_cell).
        body: Tag of each cell's volume.
        tagged: Nodes of the tagged facets, vertices first, shape (num_tagged, nodes_per_facet).
        tags: Tags of the tagged facets.
        named: Names of the tags, and names of the surfaces to mark.
    """
    gdim = 2 if cells.shape[1] in (3, 6) else 3
    points = np.zeros((len(x), 3))
    points[:, : x.shape[1]] = x
    corners = cells[:, : gdim + 1].astype(np.int64)
    facets, inside = exterior(corners)
    turn_outward(facets, points, points[corners[inside]].mean(axis=1))
    triangles, below = (corners, np.arange(len(cells))) if gdim == 2 else (facets, inside)
    nodes = np.unique(triangles)
    number = np.full(len(points), -1)
    number[nodes] = np.arange(len(nodes))
    volumes, surfaces = named.volumes, named.surfaces
    names = sorted(volumes, key=lambda name: volumes[name])
    tag = facet_tags(facets, tagged[:, :gdim].astype(np.int64), tags)
    surface = Surface(
        points=points[nodes],
        triangles=number[triangles],
        edges=number[facets] if gdim == 2 else np.zeros((0, 2), dtype=np.int64),
        body=np.searchsorted([volumes[name] for name in names], body[below]),
        names=names,
        at_points={},
        at_cells={},
        marks={
            mark: np.isin(tag, [of for name in on for of in surfaces.get(name, ())])
            for mark, on in named.scene.marks.items()
        },
    )
    return Skin(surface, nodes, below, tag)


def exterior(cells: Longs) -> tuple[Longs, Longs]:
    """Return the facets that belong to a single cell.

    Args:
        cells: Vertices of simplices, shape (num_cells, gdim + 1).

    Returns:
        Vertices of the facets in ascending order, shape (num_facets, gdim), and their cells.
    """
    size, number = cells.shape[1], int(cells.max(initial=0)) + 1
    corners = np.array(list(combinations(range(size), size - 1)))
    facets = np.sort(cells, axis=1)[:, corners].reshape(-1, size - 1)
    key = facets[:, 0]
    for column in facets.T[1:]:  # number the facets such that equal facets have equal numbers
        _, first, key, count = np.unique(
            key * number + column, return_index=True, return_inverse=True, return_counts=True
        )
    alone = np.sort(first[count == 1])
    return facets[alone], alone // len(corners)


def facet_tags(facets: Longs, tagged: Longs, tags: npt.NDArray[np.integer[Any]]) -> Longs:
    """Return the tag of each facet, −1 if it has no tag, for any order of its vertices.

    Args:
        facets: Vertices of facets, shape (num_facets, gdim).
        tagged: Vertices of the tagged facets, in the same form.
        tags: Tags of the tagged facets.
    """
    rows = np.sort(np.concatenate([tagged, facets]), axis=1)
    _, same = np.unique(rows, axis=0, return_inverse=True)
    of_row = np.full(len(rows), -1, dtype=np.int64)
    of_row[same.ravel()[: len(tagged)]] = tags
    return of_row[same.ravel()[len(tagged) :]]


def turn_outward(corners: npt.NDArray[Any], x: Floats, centres: Floats) -> None:
    """Order the corners of facets in place such that normals point out of the facets' cells.

    Args:
        corners: Indices of points, shape (num_facets, 2 or 3); changed in place.
        x: The points, shape (num_points, 3).
        centres: Centre of each facet's cell, shape (num_facets, 3).
    """
    from_inside: Floats = x[corners[:, 0]] - centres
    inward = np.einsum("ni,ni->n", _normals(x, corners), from_inside) < 0
    corners[inward, -2:] = corners[inward, :-3:-1]


def _normals(points: Floats, facets: npt.NDArray[np.integer]) -> Floats:
    """Return normals, whose norms are areas or lengths; normals of edges point to the right."""
    along = points[facets[:, 1]] - points[facets[:, 0]]
    if facets.shape[1] == 2:
        return np.cross(along, [0.0, 0.0, 1.0])
    return np.cross(along, points[facets[:, 2]] - points[facets[:, 0]]) / 2
