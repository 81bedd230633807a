"""Pairs of boxes that meet, one of each of two sets, found on grids as coarse as both."""

from collections.abc import Iterator
from itertools import product

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.proof.load_kinds import Floats

Longs = npt.NDArray[np.int64]

AT_ONCE = 1_000_000
"""Pairs that are looked at together, for the memory they take."""


def box_pairs(ones: Floats, others: Floats) -> Iterator[tuple[Longs, Longs]]:
    """Numbers of boxes that meet, each pair once, some at a time.

    Args:
        ones: Least and largest coordinates of boxes, shape (2, n, d); none is a point.
        others: The same of others.
    """
    if not (ones.shape[1] and others.shape[1]):
        return
    every = [(boxes, _levels(boxes)) for boxes in (ones, others)]
    for level, beside in product(*([int(k) for k in np.unique(of)] for _, of in every)):
        edge = np.ldexp(1.0, max(level, beside))
        some = [
            np.flatnonzero(levels == k)
            for (_, levels), k in zip(every, (level, beside), strict=True)
        ]
        grids = [
            np.floor(boxes[:, at] / edge).astype(np.int64)
            for (boxes, _), at in zip(every, some, strict=True)
        ]
        for i, j in _on_grid(*grids):
            a, b = some[0][i], some[1][j]
            meet = (ones[0, a] <= others[1, b]) & (others[0, b] <= ones[1, a])
            kept = meet.all(axis=1)
            yield a[kept], b[kept]


def _levels(boxes: Floats) -> Longs:
    """Least powers of 2 that are no smaller than a box."""
    return np.ceil(np.log2((boxes[1] - boxes[0]).max(axis=1))).astype(np.int64)


def _on_grid(ones: Longs, others: Longs) -> Iterator[tuple[Longs, Longs]]:
    """The pairs that have places on a grid in common, each at the first of these.

    Args:
        ones: First and last places, of which there are two along an axis at most, (2, n, d).
        others: The same of others.
    """
    keys, members, places = _entries(ones)
    keys_there, members_there, _ = _entries(others)
    order = np.argsort(keys_there, kind="stable")
    keys_there, members_there = keys_there[order], members_there[order]
    start = np.searchsorted(keys_there, keys, side="left")
    number = np.searchsorted(keys_there, keys, side="right") - start
    pieces = np.cumsum(number) // AT_ONCE
    for piece in np.split(np.arange(len(keys)), np.flatnonzero(np.diff(pieces)) + 1):
        many = number[piece]
        within = np.arange(int(many.sum())) - np.repeat(np.cumsum(many) - many, many)
        entry = np.repeat(piece, many)
        i, j = members[entry], members_there[np.repeat(start[piece], many) + within]
        first = np.maximum(ones[0, i], others[0, j])
        kept = ((places[entry] == first) & (first <= others[1, j])).all(axis=1)
        yield i[kept], j[kept]


def _entries(grid: Longs) -> tuple[Longs, Longs, Longs]:
    """Number of each place that a box has, the box, and the place."""
    found = []
    for corner in product((0, 1), repeat=grid.shape[2]):
        place = grid[0] + np.array(corner)
        there = np.flatnonzero((place <= grid[1]).all(axis=1))
        found.append((there, place[there]))
    places = np.concatenate([place for _, place in found])
    # of different places they may be equal, and seldom are
    factors = np.array([73_856_093, 19_349_663 << 20, 83_492_791 << 34])[: places.shape[1]]
    return places @ factors, np.concatenate([there for there, _ in found]), places
