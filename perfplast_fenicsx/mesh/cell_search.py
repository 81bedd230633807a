"""Find the cells near points: candidates for overlap or contact."""

from collections.abc import Iterator
from itertools import chain

import numpy as np
from scipy.spatial import KDTree

from perfplast_fenicsx.arrays import Floats, Longs


class CellSearch:
    """Search for cells by position; one tree for cells of about the same size."""

    def __init__(self, x: Floats) -> None:
        """Put cells into trees.

        Args:
            x: Their vertices, shape (num_cells, gdim + 1, gdim).
        """
        centres = x.mean(axis=1)
        radii = np.linalg.norm(x - centres[:, None], axis=2).max(axis=1)
        sizes = np.floor(np.log2(radii / radii.min(initial=np.inf)))
        self._trees: list[tuple[KDTree, Longs, float]] = []
        for size in np.unique(sizes):
            cells = np.flatnonzero(sizes == size)
            self._trees.append((KDTree(centres[cells]), cells, float(radii[cells].max())))

    def near(self, points: Floats, within: Floats) -> Iterator[tuple[Longs, Longs]]:
        """Yield pairs of a point and a cell within a distance, and some pairs farther apart.

        Args:
            points: Points, shape (n, gdim).
            within: Largest distance of each point, shape (n,).

        Yields:
            Indices of points and of cells; each pair occurs once.
        """
        # Number of points in one search, which bounds the memory for pairs.
        at_once = 20_000
        for tree, cells, radius in self._trees:
            for first in range(0, len(points), at_once):
                some = slice(first, first + at_once)
                found = tree.query_ball_point(points[some], within[some] + radius)
                counts = np.fromiter(map(len, found), dtype=np.int64, count=len(found))
                members = np.fromiter(
                    chain.from_iterable(found), dtype=np.int64, count=int(counts.sum())
                )
                yield np.repeat(np.arange(first, first + len(found)), counts), cells[members]
