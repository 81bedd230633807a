"""Find bodies with only one element through their thickness: too few for bending."""

from itertools import combinations

import gmsh
import numpy as np

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.geometry.parts import Part

MOST = 0.5
"""Share of a body's elements that may reach from side to side without a remark."""


def share_through(dim: int, part: Part) -> float:
    """Return the share of a body's elements with an edge between opposite sides of its surface."""
    cells = []
    for tag in part.tags:
        kinds, _, nodes = gmsh.model.mesh.getElements(dim, tag)
        for kind, numbers in zip(kinds, nodes, strict=True):
            size = gmsh.model.mesh.getElementProperties(kind)[3]
            cells.append(numbers.reshape(-1, size)[:, : dim + 1])
    corners = np.concatenate(cells).astype(np.int64)
    tags, points, _ = gmsh.model.mesh.getNodes()
    order = np.argsort(tags)
    numbers, local = np.unique(corners, return_inverse=True)
    places = np.asarray(points).reshape(-1, 3)[order[np.searchsorted(tags[order], numbers)]]
    return through(places[:, :dim], local.reshape(corners.shape))


def through(points: Floats, cells: Longs) -> float:
    """Return the share of simplices with an edge whose ends have opposite outward normals.

    Args:
        points: Coordinates, shape (num_points, d).
        cells: Vertices of the simplices, shape (num_cells, d + 1).
    """
    dim = points.shape[1]
    facets = np.concatenate([np.delete(cells, corner, axis=1) for corner in range(dim + 1)])
    behind = np.concatenate([cells[:, corner] for corner in range(dim + 1)])
    _, first, count = np.unique(
        np.sort(facets, axis=1), axis=0, return_index=True, return_counts=True
    )
    outer, inside = facets[first[count == 1]], behind[first[count == 1]]
    edges = points[outer[:, 1:]] - points[outer[:, :1]]
    if dim == 3:
        normals = np.cross(edges[:, 0], edges[:, 1])
    else:
        normals = np.column_stack([edges[:, 0, 1], -edges[:, 0, 0]])
    inwards = np.einsum("ni,ni->n", normals, points[inside] - points[outer[:, 0]]) > 0
    normals[inwards] *= -1
    at_points = np.zeros_like(points)
    np.add.at(at_points, outer.ravel(), np.repeat(normals, dim, axis=0))
    sizes = np.linalg.norm(at_points, axis=1, keepdims=True)
    at_points /= np.where(sizes > 0, sizes, 1.0)  # none inside the body
    reaches = np.zeros(len(cells), dtype=np.bool_)
    # Cosine of the angle of outward normals below which surfaces are opposite sides.
    opposite = -0.8
    for a, b in combinations(range(dim + 1), 2):
        cosines = np.einsum("ni,ni->n", at_points[cells[:, a]], at_points[cells[:, b]])
        reaches |= cosines < opposite
    return float(reaches.mean())
