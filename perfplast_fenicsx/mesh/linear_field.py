"""Define a function that is linear in each cell of a mesh with straight cells."""

import numpy as np

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.errors import InputError, place_of
from perfplast_fenicsx.mesh.overlapping_bodies import CellSearch
from perfplast_fenicsx.mesh.straight_geometry import gradients


class LinearField:
    """A function that is linear in each cell, given by values at the vertices.

    Each cell has separate values, so the function may jump between cells.
    """

    def __init__(self, corners: Floats, values: Floats) -> None:
        """Store the vertices of the cells and the values of the function.

        Args:
            corners: Vertices of the cells, shape (num_cells, d + 1, d).
            values: Values at the vertices, shape (num_cells, d + 1).
        """
        self._corners, self._values = corners, values
        self._search: CellSearch | None = None

    def at_corners(self, corners: Floats) -> Floats:
        """Return the values at the vertices of cells that each lie in a cell of the field.

        Args:
            corners: Vertices of the cells, shape (n, d + 1, d).

        Returns:
            Values, shape (n, d + 1).

        Raises:
            InputError: If the centre of a cell lies in no cell of the field.
        """
        where = self._cells_at(corners.mean(axis=1))
        shares = _shares(self._corners[where], corners)
        found: Floats = np.einsum("nab,nb->na", shares, self._values[where])
        return found

    def _cells_at(self, points: Floats) -> Longs:
        """Return the index of the field's cell that contains each point."""
        self._search = self._search or CellSearch(self._corners)
        best, where = np.full(len(points), -np.inf), np.zeros(len(points), dtype=np.int64)
        for point, cell in self._search.near(points, np.zeros(len(points))):
            least = _shares(self._corners[cell], points[point][:, None])[:, 0].min(axis=1)
            # if a point lies in several cells, the last assignment remains: the cell in which the
            # least barycentric coordinate is largest
            order = np.argsort(least)
            point, cell, least = point[order], cell[order], least[order]
            better = least > best[point]
            where[point[better]] = cell[better]
            np.maximum.at(best, point, least)
        # a point is outside a cell if its least barycentric coordinate is below minus this value
        outside = 1e-9
        if (best < -outside).any():
            at = place_of(points[np.argmax(best < -outside)])
            raise InputError(
                f"the field has no value at {at}; give a field that covers the whole body."
            )
        return where


def _shares(cells: Floats, points: Floats) -> Floats:
    """Return the barycentric coordinates of points in cells.

    Args:
        cells: Vertices, shape (n, d + 1, d).
        points: Points for each cell, shape (n, k, d).

    Returns:
        Barycentric coordinates, shape (n, k, d + 1).
    """
    offsets = points - cells[:, :1]
    found: Floats = np.einsum("nki,nai->nka", offsets, gradients(cells)[0])
    found[..., 0] += 1.0
    return found
