"""Whether cells overlap: whether points of cells are in another cell too.

Where inner facets have their cells on both sides, the number of cells around a point changes only
where an outer facet is crossed, and each body has such facets. So points just inside of them show
what overlaps, and what lies in others.
"""

import numpy as np

from perfplast_fenicsx.proof.body import Body, Floats, Longs
from perfplast_fenicsx.proof.box_pairs import keys_of


def overlapping(body: Body) -> int:
    """How many of the points are in another cell than their own."""
    points, own = _points(body)
    first = body.vertices[body.cells]
    low, high = first.min(axis=1), first.max(axis=1)
    levels = np.ceil(np.log2((high - low).max(axis=1))).astype(np.int64)
    origin, count = low.min(axis=0), 0
    low, high = np.asfortranarray(low), np.asfortranarray(high)
    # Pairs of points and cells that are looked at together, for the memory they take.
    at_once = 1_000_000
    for level in np.unique(levels):
        some = np.flatnonzero(levels == level)
        edge = np.ldexp(1.0, int(level))
        begin = np.floor((low[some] - origin) / edge).astype(np.int64)
        end = np.floor((high[some] - origin) / edge).astype(np.int64)
        keys, cells = [], []
        for corner in np.ndindex(*([2] * body.dim)):
            box = begin + np.array(corner)
            there = (box <= end).all(axis=1)
            keys.append(keys_of(box[there]))
            cells.append(some[there])
        every, members = np.concatenate(keys), np.concatenate(cells)
        order = np.argsort(every, kind="stable")
        every, members = every[order], members[order]
        wanted = keys_of(np.floor((points - origin) / edge).astype(np.int64))
        start = np.searchsorted(every, wanted, side="left")
        number = np.searchsorted(every, wanted, side="right") - start
        pieces = np.cumsum(number) // at_once
        for piece in np.split(np.arange(len(points)), np.flatnonzero(np.diff(pieces)) + 1):
            of = np.repeat(piece, number[piece])
            within = np.arange(len(of)) - np.repeat(
                np.cumsum(number[piece]) - number[piece], number[piece]
            )
            in_cell = members[np.repeat(start[piece], number[piece]) + within]
            may = in_cell != own[of]
            for axis in range(body.dim):
                of, in_cell = of[may], in_cell[may]
                at = points[of, axis]
                may = (low[in_cell, axis] < at) & (at < high[in_cell, axis])
            count += _count_inside(body, points[of[may]], in_cell[may])
    return count


def _points(body: Body) -> tuple[Floats, Longs]:
    """The points, and the cell that each was chosen in."""
    d = body.dim
    outer = body.sides[1]
    cells = outer // (d + 1)
    corners = body.vertices[np.take_along_axis(body.cells[cells], body.corners[outer % (d + 1)], 1)]
    opposite = body.vertices[body.cells[cells, outer % (d + 1)]]
    # Barycentric coordinates, on its facet, of a point near a vertex, of the other vertices.
    spread = 0.05
    near = np.full((d, d), spread) + (1 - d * spread) * np.eye(d)
    places = np.concatenate([near, np.full((1, d), 1 / d)])
    # How far inside of outer facets points are, as a share of their cell's height. Bodies that
    # touch overlap by rounding, which is less.
    depth = 1e-3
    inside = (1 - depth) * (places @ corners) + depth * opposite[:, None]
    return inside.reshape(-1, d), np.repeat(cells, d + 1)


def _count_inside(body: Body, points: Floats, cells: Longs) -> int:
    """How many points are in the cell beside them."""
    away = points - body.vertices[body.cells[cells, 0]]
    shares = np.einsum("pvi,pi->pv", body.gradients[cells], away)
    shares[:, 0] += 1
    # Least barycentric coordinate of a point that is in a cell and not in its boundary.
    inside = 1e-6
    return int((shares > inside).all(axis=1).sum())
