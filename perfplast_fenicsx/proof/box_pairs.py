"""Find intersecting pairs of boxes from two sets, by binary trees of larger boxes."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.proof.load_kinds import Floats
from perfplast_fenicsx.proof.plain_arrays import ProofError

Longs = npt.NDArray[np.int64]

AT_ONCE = 300_000
"""Number of pairs that are processed together, limited by memory."""

MOST_PAIRS = 1000
"""Allowed number of compared pairs for each box; a cell of two 3D meshes has about 300 pairs."""

FEW_PAIRS = 20_000_000
"""Number of pairs that is always allowed."""

IN_LEAF = 4
"""Largest number of boxes in a leaf of a tree."""


def box_pairs(ones: Floats, others: Floats) -> Iterator[tuple[Longs, Longs]]:
    """Yield indices of intersecting boxes, each pair once, in batches.

    A binary tree for each set groups boxes that are close to each other. The function compares the
    children of two nodes only if the nodes' boxes intersect.

    Args:
        ones: Least and largest coordinates of boxes, shape (2, n, d); every box has a positive
            size.
        others: The boxes of the second set, in the same form.

    Raises:
        ProofError: If the function must compare too many pairs for the number of boxes.
    """
    if not (ones.shape[1] and others.shape[1]):
        return
    budget = max(MOST_PAIRS * (ones.shape[1] + others.shape[1]), FEW_PAIRS)
    depth = max(0, int(np.ceil(np.log2(max(ones.shape[1], others.shape[1]) / IN_LEAF))))
    trees = _Tree.of(ones, depth), _Tree.of(others, depth)
    root: Longs = np.zeros(1, dtype=np.int64)
    waiting = [(0, root, root)]
    while waiting:
        level, a, b = waiting.pop()
        budget -= len(a)
        if budget < 0:
            raise ProofError(
                "cells lie so close together that the search for overlapping cells would take too "
                "long."
            )
        low, high = (tree.levels[level] for tree in trees)
        kept = ((low[0, a] <= high[1, b]) & (high[0, b] <= low[1, a])).all(axis=1)
        a, b = a[kept], b[kept]
        if level > depth:
            yield trees[0].order[a], trees[1].order[b]
            continue
        wide = 2 if level < depth else IN_LEAF
        pieces = len(a) * wide**2 // AT_ONCE + 1
        for piece in range(pieces):  # strided, to mix pairs of all places
            below = [wide * of[piece::pieces, None] + np.arange(wide) for of in (a, b)]
            pairs = np.broadcast_arrays(below[0][:, :, None], below[1][:, None])
            waiting.append((level + 1, pairs[0].ravel(), pairs[1].ravel()))


@dataclass(frozen=True, eq=False)
class _Tree:
    """A binary tree of boxes.

    Attributes:
        levels: Bounding boxes of the nodes on each level, from the root to the leaves, and last the
            boxes themselves; shape (2, n, d). Boxes that only fill the last leaves are empty and
            intersect nothing.
        order: Index of each box on the last level; −1 for boxes that only fill leaves.
    """

    levels: list[Floats]
    order: Longs

    @classmethod
    def of(cls, boxes: Floats, depth: int) -> "_Tree":
        """Return a tree of the given depth for ``boxes``. A leaf has ``IN_LEAF`` boxes."""
        _, count, d = boxes.shape
        size = IN_LEAF * 2**depth
        middle = boxes.sum(axis=0)
        order = np.full(size, -1, dtype=np.int64)
        order[:count] = np.arange(count)
        for level in range(depth):  # halves each node along its longest side
            parts = order.reshape(2**level, -1)
            x, filled = middle[parts], parts[..., None] >= 0
            highest = np.where(filled, x, -np.inf).max(axis=1)
            along = np.argmax(highest - np.where(filled, x, np.inf).min(axis=1), axis=1)
            keys = np.take_along_axis(np.where(filled, x, np.inf), along[:, None, None], axis=2)
            sorting = np.argsort(keys[..., 0], axis=1, kind="stable")
            order = np.take_along_axis(parts, sorting, axis=1).ravel()
        own = np.stack([np.full((size, d), np.inf), np.full((size, d), -np.inf)])
        own[:, order >= 0] = boxes[:, order[order >= 0]]
        levels = [own]
        for wide in (IN_LEAF, *(2 for _ in range(depth))):
            low, high = levels[0].reshape(2, -1, wide, d)
            levels.insert(0, np.stack([low.min(axis=1), high.max(axis=1)]))
        return cls(levels, order)
