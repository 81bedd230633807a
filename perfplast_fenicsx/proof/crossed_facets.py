"""Find outer facets of one half that lie inside the other half, where its cells are connected.

If outer facets coincide only up to rounding, a narrow strip of a cut can be closed in one half.
Then a cell of this half extends to both sides of the cut, or an inner facet lies in the cut. The
module compares the overlap with the size of these cells, however small they are.
"""

import numpy as np

from perfplast_fenicsx.proof.body import Body, Flags, Floats
from perfplast_fenicsx.proof.box_pairs import box_pairs
from perfplast_fenicsx.proof.shared_cells import boxes_of
from perfplast_fenicsx.proof.shared_facets import common_parts

NARROW = 1e-3
"""Depth in a cell that counts as zero, relative to the least height of the cell; also the share of
an inner facet."""


def crossed(one: Body, other: Body) -> Floats:
    """Return centres of cells through which outer facets of the other half extend."""
    if np.array_equal(one.vertices, other.vertices) and np.array_equal(one.cells, other.cells):
        return np.zeros((0, one.dim))
    return np.concatenate([_crossed(one, other), _crossed(other, one)])


def _crossed(one: Body, other: Body) -> Floats:
    """Return centres of cells of ``one`` through which outer facets of ``other`` extend."""
    d, wide = one.dim, one.dim + 1
    places, facets = one.vertices[one.cells], other.vertices[other.facets]
    least = 1 / np.linalg.norm(one.gradients, axis=2).max(axis=1)
    corners = one.cells[:, one.corners].reshape(-1, d)
    inner = np.zeros(one.cells.size, dtype=bool)
    inner[one.sides[0]] = True
    on_cut, found = np.zeros(one.cells.size), np.zeros(len(one.cells), dtype=bool)
    near = NARROW * least[:, None] * np.array([-1.0, 1.0])[:, None, None]
    for a, b in box_pairs(boxes_of(places) + near, boxes_of(facets)):
        heights = np.einsum("pvi,pi->pv", places[a] - facets[b][:, :1], other.normals[b])
        most = NARROW * least[a]
        through = np.minimum(heights.max(axis=1), -heights.min(axis=1)) > most
        at, on = a[through], b[through]
        found[at[_overlap(places[at], facets[on], other.normals[on], most[through])]] = True
        far = np.abs(heights) > most[:, None]
        sides = a * wide + np.argmax(far, axis=1)
        flat = (far.sum(axis=1) == 1) & inner[sides]
        sides, on = sides[flat], b[flat]
        x = one.vertices[corners[sides]]
        np.add.at(on_cut, sides, common_parts(x, facets[on], other.normals[on]))
    pairs = one.sides[0]
    cut = (on_cut[pairs] > NARROW * one.areas_of(pairs[:, 0])[:, None]).all(axis=1)
    found[pairs[cut, 0] // wide] = True
    return np.asarray(places[found].mean(axis=1))


def _overlap(cells: Floats, facets: Floats, normals: Floats, most: Floats) -> Flags:
    """Return flags of cells through which facets extend: no motion by ``most`` separates them.

    The cells have vertices on both sides of the facets' planes.
    """
    i, j = np.triu_indices(cells.shape[2] + 1, 1)
    edges = cells[:, j] - cells[:, i]
    if cells.shape[2] == 2:
        every = np.stack([-edges[..., 1], edges[..., 0]], axis=2)
    else:
        ends = np.concatenate([edges, np.roll(facets, -1, axis=1) - facets], axis=1)
        every = np.cross(edges[:, :, None], ends[:, None]).reshape(len(cells), 54, 3)
    lengths = np.linalg.norm(every, axis=2, keepdims=True)
    every = every / np.where(lengths > 0, lengths, 1.0)
    start = cells[:, :1]
    mine, theirs = (np.einsum("pvi,pai->pav", x - start, every) for x in (cells, facets))
    depth = np.minimum(mine.max(axis=2) - theirs.min(axis=2), theirs.max(axis=2) - mine.min(axis=2))
    return np.asarray(((depth > most[:, None]) | (lengths[..., 0] == 0)).all(axis=1))
