"""Find the outer facets of a mesh of simplices by their corners."""

from itertools import combinations

import numpy as np

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.errors import InputError

NOWHERE = -1


class OuterFacets:
    """Facets that belong to a single cell.

    Attributes:
        corners: Corners of each facet, sorted by number, shape (num_facets, dim).
        cells: Cell of each facet, shape (num_facets,).
    """

    def __init__(self, cells: Longs, num_points: int) -> None:
        """Find the outer facets.

        Args:
            cells: Corners of all simplices, shape (m, dim + 1).
            num_points: Number of points.

        Raises:
            InputError: If there are too many points.
        """
        # With more points the key of a triangle would not fit into 63 bits.
        most_points = 2_000_000
        if num_points > most_points:
            raise InputError(
                f"the model has {num_points} nodes, more than {most_points}; take a coarser mesh."
            )
        dim = cells.shape[1] - 1
        self._base = np.int64(max(num_points, 1))
        sides = [list(side) for side in combinations(range(dim + 1), dim)]
        every = np.sort(np.concatenate([cells[:, side] for side in sides]), axis=1)
        owners = np.tile(np.arange(len(cells)), len(sides))
        keys = self._keys(every)
        order = np.argsort(keys, kind="stable")
        ordered = keys[order]
        first = np.concatenate([[True], ordered[1:] != ordered[:-1]])
        alone = first & np.concatenate([first[1:], [True]])
        chosen = order[alone]
        self._found = ordered[alone]
        self.corners, self.cells = every[chosen], owners[chosen]

    def outwards(self, points: Floats, cells: Longs) -> Longs:
        """Return corners of triangles, counterclockwise as seen from outside.

        Args:
            points: Coordinates of the points, shape (n, 3).
            cells: The cells given to the constructor.
        """
        a, b, c = (points[self.corners[:, k]] for k in range(3))
        inside = points[cells[self.cells]].mean(axis=1)
        volume = np.einsum("ni,ni->n", np.cross(b - a, c - a), inside - a)
        turned: Longs = np.where((volume > 0)[:, None], self.corners[:, [0, 2, 1]], self.corners)
        return turned

    def _keys(self, corners: Longs) -> Longs:
        keys = np.zeros(len(corners), dtype=np.int64)
        for column in corners.T:
            keys = keys * self._base + column
        return keys

    def find(self, corners: Longs) -> Longs:
        """Return the number of each facet by its corners in any order, or -1; shape (n,)."""
        keys = self._keys(np.sort(corners, axis=1))
        at = np.minimum(np.searchsorted(self._found, keys), max(len(self._found) - 1, 0))
        there = self._found[at] == keys if len(self._found) else np.zeros(len(keys), dtype=bool)
        return np.where(there, at, NOWHERE)

    def among(self, points: Longs, num_points: int) -> Longs:
        """Return the numbers of the facets whose corners are all among some points."""
        chosen = np.zeros(num_points, dtype=bool)
        chosen[points] = True
        return np.flatnonzero(chosen[self.corners].all(axis=1))
