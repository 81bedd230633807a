"""Pairs of boxes that meet, one of each of two sets, found on grids as coarse as both."""

from collections.abc import Iterator
from itertools import product

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.proof.load_kinds import Floats
from perfplast_fenicsx.proof.plain_arrays import ProofError

Longs = npt.NDArray[np.int64]

AT_ONCE = 300_000
"""Pairs that are looked at together, for the memory they take."""

MOST_PAIRS = 500
"""Pairs on the grid that there may be for each box; usual cells have some dozens."""

FEW_PAIRS = 20_000_000
"""Pairs that there may be in any case."""


def box_pairs(ones: Floats, others: Floats) -> Iterator[tuple[Longs, Longs]]:
    """Yield numbers of boxes that meet, each pair once, some at a time.

    There is one grid for each size of the larger box of a pair, on which all smaller ones are found
    as well: so each box is entered once for each size there is.

    Args:
        ones: Least and largest coordinates of boxes, shape (2, n, d); none is a point.
        others: The same of others.

    Raises:
        ProofError: If too many boxes meet for their number.
    """
    if not (ones.shape[1] and others.shape[1]):
        return
    budget = max(MOST_PAIRS * (ones.shape[1] + others.shape[1]), FEW_PAIRS)
    every = [(boxes, _levels(boxes)) for boxes in (ones, others)]
    for level in np.unique(np.concatenate([levels for _, levels in every])):
        edge = np.ldexp(1.0, int(level))
        at, below = (
            [np.flatnonzero(test(levels, level)) for _, levels in every]
            for test in (np.equal, np.less)
        )
        for some in ((at[0], np.append(at[1], below[1])), (below[0], at[1])):
            if not (len(some[0]) and len(some[1])):
                continue
            grids = [
                np.floor(boxes[:, of] / edge).astype(np.int64)
                for (boxes, _), of in zip(every, some, strict=True)
            ]
            for i, j in _on_grid(*grids):
                budget -= len(i)
                if budget < 0:
                    raise ProofError(
                        "cells lie so closely beside each other that it would take too long to"
                        " find which of them overlap."
                    )
                a, b = some[0][i], some[1][j]
                meet = (ones[0, a] <= others[1, b]) & (others[0, b] <= ones[1, a])
                kept = meet.all(axis=1)
                yield a[kept], b[kept]


def _levels(boxes: Floats) -> Longs:
    """Least powers of 2 that are no smaller than a box."""
    return np.ceil(np.log2((boxes[1] - boxes[0]).max(axis=1))).astype(np.int64)


def _on_grid(ones: Longs, others: Longs) -> Iterator[tuple[Longs, Longs]]:
    """Yield the pairs that have places on a grid in common, each at the first of these.

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
    """Return the number of each place that a box has, the box, and the place."""
    found = []
    for corner in product((0, 1), repeat=grid.shape[2]):
        place = grid[0] + np.array(corner)
        there = np.flatnonzero((place <= grid[1]).all(axis=1))
        found.append((there, place[there]))
    places = np.concatenate([place for _, place in found])
    # of different places they may be equal, and seldom are
    factors = np.array([73_856_093, 19_349_663 << 20, 83_492_791 << 34])[: places.shape[1]]
    return places @ factors, np.concatenate([there for there, _ in found]), places
