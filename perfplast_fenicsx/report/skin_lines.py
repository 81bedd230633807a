"""Find the lines that show the shape of a skin: sharp edges, and boundaries of bodies."""

import numpy as np

from perfplast_fenicsx.arrays import Longs
from perfplast_fenicsx.pictures.boundary_surface import Surface


def skin_lines(surface: Surface) -> tuple[Longs, Longs]:
    """Return edges of triangles that are drawn as lines.

    Returns:
        Indices of points, shape (num_lines, 2), and the body of each line, in ascending order.
    """
    corners = np.concatenate([surface.triangles[:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0))])
    edges = np.sort(corners, axis=1)
    triangle = np.tile(np.arange(len(surface.triangles)), 3)
    key = edges[:, 0] * len(surface.points) + edges[:, 1]
    order = np.argsort(key, kind="stable")
    _, first, count = np.unique(key[order], return_index=True, return_counts=True)
    a, b = order[first], order[first + (count > 1)]
    normals = _unit_normals(surface)
    # Triangles at a larger angle meet at a line.
    least_cosine = np.cos(np.radians(30.0))
    smooth = np.einsum("ni,ni->n", normals[triangle[a]], normals[triangle[b]]) > least_cosine
    same = surface.body[triangle[a]] == surface.body[triangle[b]]
    shown = a[(count != 2) | ~smooth | ~same]
    body = surface.body[triangle[shown]]
    by_body = np.argsort(body, kind="stable")
    return edges[shown[by_body]], body[by_body]


def _unit_normals(surface: Surface) -> np.ndarray:
    p, q, r = (surface.points[corner] for corner in surface.triangles.T)
    normals = np.cross(q - p, r - p)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.asarray(normals / np.where(lengths > 0, lengths, 1.0))
