"""Divide a simplex by repeatedly halving its edges."""

from functools import lru_cache

import numpy as np

from perfplast_fenicsx.proof.load_kinds import Floats

CHILDREN = {
    2: ("00 01 02", "01 11 12", "02 12 22", "01 02 12"),
    3: (
        *("00 01 02 03", "01 11 12 13", "02 12 22 23", "03 13 23 33"),
        *("01 02 03 13", "01 02 12 13", "02 03 13 23", "02 12 13 23"),
    ),
}
"""Parts of a simplex with halved edges, by dimension. Each vertex of a part is written as two
vertices of the simplex between which it is the middle. For a vertex of the simplex, both are the
same. The order follows J. Bey, Tetrahedral grid refinement, Computing 55 (1995), 355."""


@lru_cache
def parts_of(dim: int, times: int) -> Floats:
    """Return barycentric coordinates of the parts' vertices, (num_parts, dim + 1, dim + 1)."""
    parts: Floats = np.eye(dim + 1)[None]
    ends = np.array([[list(map(int, edge)) for edge in child.split()] for child in CHILDREN[dim]])
    for _ in range(times):
        parts = ((parts[:, ends[..., 0]] + parts[:, ends[..., 1]]) / 2).reshape(
            -1, dim + 1, dim + 1
        )
    return parts


@lru_cache
def halved(dim: int, times: int) -> tuple[Floats, Floats]:
    """Return the points and weights of the vertex rule on the parts.

    Returns:
        Barycentric coordinates, shape (num_points, dim + 1), and shares of the volume, of the same
        shape. A share is the mean of a point's hat function times a barycentric coordinate. The
        weight of a point is the sum of its shares.
    """
    parts = parts_of(dim, times)
    points, inverse = np.unique(parts.reshape(-1, dim + 1), axis=0, return_inverse=True)
    shares = np.zeros_like(points)
    each = mean_shares(parts) / len(parts)
    np.add.at(shares, inverse.reshape(-1, dim + 1), each)
    return points, shares


def mean_shares(values: Floats) -> Floats:
    """Return the means of linear functions times each barycentric coordinate of simplices.

    Args:
        values: Values of the functions at the vertices k, shape (..., dim + 1, n).

    Returns:
        ∫ λ_k f divided by the volume, of the same shape as the values. Entry k is f_k plus the sum
        of all values, divided by (dim + 1)(dim + 2).
    """
    n = values.shape[-2]
    return np.asarray((values + values.sum(axis=-2, keepdims=True)) / (n * (n + 1)))
