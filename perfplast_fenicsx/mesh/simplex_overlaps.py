"""Measure how deep simplices overlap, by the separating axis theorem.

S. Gottschalk, M. C. Lin, D. Manocha, OBBTree, SIGGRAPH 1996, for boxes: two convex polytopes are
separate if and only if they are separate along a normal of a face of one, or along a cross product
of two edges.
"""

from collections.abc import Callable, Iterator
from functools import partial
from itertools import product

import numpy as np

from perfplast_fenicsx.arrays import Floats

AxisOf = Callable[[Floats, Floats], tuple[Floats, Floats]]


def overlap_depths(one: Floats, other: Floats, least: Floats) -> Floats:
    """Return the distance by which one simplex of each pair must move to separate them.

    Args:
        one: Vertices of one simplex, shape (n, gdim + 1, gdim).
        other: Vertices of the other one, same shape.
        least: Depths up to this are ignored, shape (n,).

    Returns:
        Depths, shape (n,), length; 0 for separate simplices.
    """
    depth = np.full(len(one), np.inf)
    left = np.arange(len(one))
    parallel = 1e-9  # sine of the angle of two edges below which their product is ignored
    for axis_of in _axes(one.shape[2]):
        axis, size = axis_of(one[left], other[left])
        length = np.linalg.norm(axis, axis=1)
        there = length > parallel * size
        axis = axis / np.where(there, length, 1.0)[:, None]
        a, b = (np.einsum("nki,ni->nk", x[left], axis) for x in (one, other))
        moved = np.minimum(a.max(axis=1) - b.min(axis=1), b.max(axis=1) - a.min(axis=1))
        moved[~there] = np.inf
        depth[left] = np.minimum(depth[left], moved)
        left = left[moved > least[left]]
    found = np.zeros(len(one))
    found[left] = depth[left]
    return found


def _axes(gdim: int) -> Iterator[AxisOf]:
    """Yield functions that create axes, with the length of an axis if nothing were parallel."""
    for which in (0, 1):
        for place in range(gdim + 1):
            yield partial(_face_normal, which, place)
    if gdim == 3:
        edges = ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3))
        for first, second in product(edges, edges):
            yield partial(_edge_product, first, second)


def _face_normal(which: int, place: int, *x: Floats) -> tuple[Floats, Floats]:
    """Return normals of the facet opposite a vertex of one of the simplices, and lengths."""
    corner, *rest = np.delete(np.arange(x[0].shape[1]), place)
    edges = [x[which][:, other] - x[which][:, corner] for other in rest]
    if len(edges) == 2:
        return _cross(*edges)
    normal = np.column_stack([edges[0][:, 1], -edges[0][:, 0]])
    return normal, np.asarray(np.linalg.norm(normal, axis=1))


def _edge_product(
    first: tuple[int, int], second: tuple[int, int], one: Floats, other: Floats
) -> tuple[Floats, Floats]:
    edges = (x[:, b] - x[:, a] for x, (a, b) in ((one, first), (other, second)))
    return _cross(*edges)


def _cross(a: Floats, b: Floats) -> tuple[Floats, Floats]:
    size = np.asarray(np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1))
    return np.asarray(np.cross(a, b)), size
