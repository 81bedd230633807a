"""Convert values between tetrahedra and the parts into which they are split."""

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.mesh.alfeld_split import AlfeldSplit


def on_parts(stress: Floats, split: AlfeldSplit) -> Floats:
    """Return the stress on the parts of cells as a stress on the cells of the split mesh."""
    parts = split.mesh.topology.dim + 1
    return of_parts(stress.reshape(len(stress), parts, parts, stress.shape[2]), split)


def of_parts(values: Floats, split: AlfeldSplit) -> Floats:
    """Return values by cell, shape (num_cells, d + 1, ...), as values of the split mesh's cells."""
    chosen: Floats = values[split.parents, _places(split)]
    return chosen


def by_cells(values: Floats, split: AlfeldSplit) -> Floats:
    """Return values of the split mesh's cells, grouped by parent cell.

    The inverse of :func:`of_parts`.
    """
    parts = split.mesh.topology.dim + 1
    found: Floats = np.empty((len(values) // parts, parts, *values.shape[1:]))
    found[split.parents, _places(split)] = values
    return found


def of_parents(values: Floats, split: AlfeldSplit) -> Floats:
    """Return sums over the parts of each cell."""
    sums: Floats = np.zeros(len(values) // (split.mesh.topology.dim + 1))
    np.add.at(sums, split.parents, values)
    return sums


def _places(split: AlfeldSplit) -> npt.NDArray[np.integer]:
    """Return the index of each part in its cell."""
    original: Longs = np.asarray(split.mesh.topology.original_cell_index, dtype=np.int64)
    return original % (split.mesh.topology.dim + 1)
