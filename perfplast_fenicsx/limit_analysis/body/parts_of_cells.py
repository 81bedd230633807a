"""Values of the parts that tetrahedra are split into, and of the tetrahedra."""

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.mesh.alfeld_split import AlfeldSplit


def on_parts(stress: Floats, split: AlfeldSplit) -> Floats:
    """The stress of the parts of cells, as that of the cells of the split mesh."""
    parts = split.mesh.topology.dim + 1
    part = np.asarray(split.mesh.topology.original_cell_index) % parts
    chosen: Floats = stress.reshape(len(stress), parts, parts, stress.shape[2])[split.parents, part]
    return chosen


def of_parents(values: Floats, split: AlfeldSplit) -> Floats:
    """Sums over the parts of each cell."""
    sums: Floats = np.zeros(len(values) // (split.mesh.topology.dim + 1))
    np.add.at(sums, split.parents, values)
    return sums
