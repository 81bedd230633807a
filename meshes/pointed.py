"""Add cells around points and edges where the stress depends on the direction: stars and fans."""

import numpy as np

from meshes.tetrahedra import Booleans
from perfplast_fenicsx.arrays import Floats, Longs

Body = tuple[Floats, Longs]
"""Points (p, 3), and the point indices of tetrahedra (q, 4)."""


def star(body: Body, point: Booleans) -> Body:
    """Cut every edge opposite given points; each point then has about three times as many cells.

    Args:
        body: The body to cut.
        point: Flags of these points; no two of them are in one cell.
    """
    return cut(body, _opposite(body[1], point[body[1]], 1))


def fan(body: Body, edge: Booleans) -> Body:
    """Cut the edge opposite a singular edge in every cell around the singular edge.

    Args:
        body: The body to cut.
        edge: Flags of the points on the line of singular edges.
    """
    return cut(body, _opposite(body[1], edge[body[1]], 2))


def _opposite(cells: Longs, there: Booleans, count: int) -> Longs:
    """Return the edges between the other corners of cells with ``count`` flagged corners."""
    here = there.sum(axis=1) == count
    others = cells[here][~there[here]].reshape(-1, 4 - count)
    first, second = np.triu_indices(4 - count, 1)
    return np.stack([others[:, first], others[:, second]], axis=-1).reshape(-1, 2)


def cut(body: Body, edges: Longs) -> Body:
    """Cut edges at their midpoints, the longest first, and halve all cells around each edge.

    Args:
        body: The body to cut.
        edges: Indices of the edges' ends, shape (n, 2), in any order.
    """
    x, cells = body
    ends = np.unique(np.sort(edges, axis=1), axis=0)
    lengths = np.linalg.norm(x[ends[:, 0]] - x[ends[:, 1]], axis=1)
    for a, b in ends[np.argsort(-np.round(lengths, 9), kind="stable")]:
        around = (cells == a).any(axis=1) & (cells == b).any(axis=1)
        x = np.vstack([x, (x[a] + x[b]) / 2])
        parts = [np.where(cells[around] == end, len(x) - 1, cells[around]) for end in (a, b)]
        cells = np.concatenate([cells[~around], *parts])
    return x, cells
