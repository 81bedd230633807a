"""Find opposite vertices of two facets that lie on each other, or face each other."""

from itertools import permutations

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats, Longs

REACH = 1e-6
"""Distance of the midpoints of facets that touch, relative to the size of their surfaces."""


def facing_vertices(
    one: Floats, other: Floats, normals: Floats, turned: bool = False
) -> tuple[Longs, Floats]:
    """Return the vertex of the other facet opposite each vertex, and its distance along the facet.

    Args:
        one: Vertices of facets, shape (n, d, d).
        other: Vertices of the opposite facets, shape (n, d, d).
        normals: Unit normals out of the first ones, shape (n, d).
        turned: Whether they are sections of rings, which face each other only at equal radii.

    Returns:
        Shapes (n, d) and (n,) (length).
    """
    best = np.full(len(one), np.inf)
    order = np.zeros(one.shape[:2], dtype=np.int64)
    for permutation in permutations(range(one.shape[1])):
        between = other[:, permutation] - one
        along = np.einsum("fvi,fi->fv", between, normals).mean(axis=1)
        between = between - along[:, None, None] * normals[:, None]
        if turned:
            between[..., 0] += (along * normals[:, 0])[:, None]
        off = np.linalg.norm(between, axis=2).max(axis=1, initial=0.0)
        order[off < best] = permutation
        best = np.minimum(off, best)
    return order, best


def fit(one: Floats, off: Floats, normals: Floats, others: Floats) -> npt.NDArray[np.bool_]:
    """Return flags of the facets that coincide with their opposite to rounding, shape (n,).

    Args:
        one: Vertices of facets, shape (n, d, d).
        off: Distances of the opposite vertices (:func:`facing_vertices`).
        normals: Unit normals of the facets, shape (n, d).
        others: Unit normals of the opposite facets, shape (n, d).
    """
    # Distance of vertices, relative to the facet, and difference of normals.
    rounding = 1e-8
    size = np.ptp(one, axis=1).max(axis=1)
    askew = np.linalg.norm(normals + others, axis=1)
    found: npt.NDArray[np.bool_] = (off <= rounding * size) & (askew <= rounding)
    return found
