"""Number the Bernstein coefficients of a quadratic velocity, at vertices and edges."""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from perfplast_fenicsx.proof.body import Body, Longs


@dataclass(frozen=True)
class Places:
    """The points of Bernstein coefficients: first the vertices, then the edges.

    Attributes:
        of_cells: Indices of each cell's points: its vertices, then its edges 01, 02, ..., 12, ...;
            shape (num_cells, 6 or 10).
        of_facets: Indices of each outer facet's points in the same order, shape (num_facets, 3 or
            6).
        ends: Indices of the vertices at the ends of edges, shape (num_edges, 2).
        count: Number of points.
    """

    of_cells: Longs
    of_facets: Longs
    ends: Longs
    count: int


def places_of(body: Body) -> Places:
    """Return the points of the Bernstein coefficients for given bodies."""
    d, n = body.dim, len(body.vertices)
    pairs = list(combinations(range(d + 1), 2))
    ends = np.sort(body.cells[:, pairs].reshape(-1, 2), axis=1)
    keys, numbers = np.unique(ends[:, 0] * n + ends[:, 1], return_inverse=True)
    of_cells = np.column_stack([body.cells, n + numbers.reshape(len(body.cells), -1)])
    here = numbers_in_cell(d)[body.places[:, :, None], body.places[:, None]]
    own = of_cells[body.outer // (d + 1)]
    columns = [here[:, a, a] for a in range(d)]
    columns += [here[:, a, b] for a, b in combinations(range(d), 2)]
    of_facets = np.take_along_axis(own, np.column_stack(columns), axis=1)
    return Places(of_cells, of_facets, np.column_stack([keys // n, keys % n]), n + len(keys))


def numbers_in_cell(dim: int) -> Longs:
    """Return the index of the coefficient for each pair of vertices of a cell."""
    found = np.diag(np.arange(dim + 1))
    for number, (a, b) in enumerate(combinations(range(dim + 1), 2), start=dim + 1):
        found[a, b] = found[b, a] = number
    return found
