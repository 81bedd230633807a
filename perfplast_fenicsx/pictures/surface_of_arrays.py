"""The skin of bodies whose mesh is given by arrays, as it is on file. Single-process."""

from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.io.case.scene import NamedScene
from perfplast_fenicsx.pictures.boundary_surface import Surface, turn_outward

Ints = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Skin:
    """A surface without fields, and where its values are among those of the mesh.

    Attributes:
        surface: The surface.
        nodes: Of its points, shape (num_points,).
        cells: Below its triangles, shape (num_triangles,).
    """

    surface: Surface
    nodes: Ints
    cells: Ints


def make_skin(
    x: npt.NDArray[np.float64],
    cells: npt.NDArray[np.integer[Any]],
    body: npt.NDArray[np.integer[Any]],
    tagged: npt.NDArray[np.integer[Any]],
    tags: npt.NDArray[np.integer[Any]],
    named: NamedScene,
) -> Skin:
    """Find the skin.

    Args:
        x: Nodes, shape (num_nodes, 2 or 3).
        cells: Nodes of triangles or tetrahedra, vertices first, shape (num_cells, nodes_per_cell).
        body: Tag of each cell's volume.
        tagged: Nodes of the facets with a tag, vertices first, shape (num_tagged, nodes_per_facet).
        tags: Of these facets.
        named: Names of the tags, and which surfaces are to be marked.
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
            mark: np.isin(tag, [surfaces[name] for name in on if name in surfaces])
            for mark, on in named.model.marks.items()
        },
    )
    return Skin(surface, nodes, below)


def exterior(cells: Ints) -> tuple[Ints, Ints]:
    """The facets that belong to one cell alone.

    Args:
        cells: Vertices of simplices, shape (num_cells, gdim + 1).

    Returns:
        Their vertices in rising order, shape (num_facets, gdim), and their cells.
    """
    size = cells.shape[1]
    corners = np.array(list(combinations(range(size), size - 1)))
    facets = np.sort(cells[:, corners].reshape(-1, size - 1), axis=1)
    cell = np.repeat(np.arange(len(cells)), len(corners))
    order = np.lexsort(facets.T)
    same = np.all(facets[order[1:]] == facets[order[:-1]], axis=1)
    alone = order[~(np.append(same, False) | np.append(False, same))]
    return facets[alone], cell[alone]


def facet_tags(facets: Ints, tagged: Ints, tags: npt.NDArray[np.integer[Any]]) -> Ints:
    """The tag of each facet, −1 of those without, however their vertices are ordered.

    Args:
        facets: Vertices, shape (num_facets, gdim).
        tagged: The same of facets with a tag.
        tags: Their tags.
    """
    rows = np.sort(np.concatenate([tagged, facets]), axis=1)
    _, same = np.unique(rows, axis=0, return_inverse=True)
    of_row = np.full(len(rows), -1, dtype=np.int64)
    of_row[same.ravel()[: len(tagged)]] = tags
    return of_row[same.ravel()[len(tagged) :]]
