"""Detect overlapping cells: whether points just inside outer facets are in another cell too.

Since inner facets have their cells on opposite sides, the number of cells around a point changes
only across an outer facet. So where cells overlap, the region just inside such a facet shares a
volume with a cell other than its own.
"""

import numpy as np

from perfplast_fenicsx.proof.body import Body, Floats
from perfplast_fenicsx.proof.box_pairs import box_pairs
from perfplast_fenicsx.proof.shared_cells import boxes_of, have_common_volume


def overlapping(body: Body) -> int:
    """Return how many outer facets have another cell just inside them; for many, only some."""
    slices, cells = _slices(body), body.vertices[body.cells]
    own = body.outer // (body.dim + 1)
    found = np.zeros(len(slices), dtype=bool)
    for a, b in box_pairs(boxes_of(slices), boxes_of(cells)):
        others = (own[a] != b) & ~found[a]
        a, b = a[others], b[others]
        found[a[have_common_volume(slices[a], cells[b])]] = True
        if found.any():  # one is enough to refuse the bodies
            break
    return int(found.sum())


def _slices(body: Body) -> Floats:
    """Return flat simplices just inside outer facets, each in its own cell."""
    # Their depth and thickness, relative to the height of their cell. Touching bodies overlap only
    # by rounding, which is less.
    depth = 1e-3
    cells = body.outer // (body.dim + 1)
    opposite = body.vertices[body.cells[cells, body.outer % (body.dim + 1)]][:, None]
    facets = (1 - depth) * body.vertices[body.facets] + depth * opposite
    middle = facets.mean(axis=1, keepdims=True)
    return np.concatenate([facets, (1 - depth) * middle + depth * opposite], axis=1)
