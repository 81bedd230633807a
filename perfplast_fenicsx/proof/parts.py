"""Parts of a simplex whose edges are halved some times."""

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
"""Parts of a simplex whose edges are halved, by dimension: ends of the edges whose middles are the
vertices. The order is that of J. Bey, Tetrahedral grid refinement, Computing 55 (1995), 355."""


@lru_cache
def parts_of(dim: int, times: int) -> Floats:
    """Barycentric coordinates of their vertices, shape (num_parts, dim + 1, dim + 1)."""
    parts: Floats = np.eye(dim + 1)[None]
    ends = np.array([[list(map(int, edge)) for edge in child.split()] for child in CHILDREN[dim]])
    for _ in range(times):
        parts = ((parts[:, ends[..., 0]] + parts[:, ends[..., 1]]) / 2).reshape(
            -1, dim + 1, dim + 1
        )
    return parts


@lru_cache
def halved(dim: int, times: int) -> tuple[Floats, Floats]:
    """Points and shares of the vertex rule on these parts.

    Returns:
        Barycentric coordinates, shape (num_points, dim + 1), and shares of the volume.
    """
    every = parts_of(dim, times).reshape(-1, dim + 1)
    points, inverse = np.unique(every, axis=0, return_inverse=True)
    return points, np.bincount(inverse.ravel()) / inverse.size
