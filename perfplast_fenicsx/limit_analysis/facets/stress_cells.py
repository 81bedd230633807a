"""Formulate cells with linear stress: their equilibrium, and the strain rates of its multipliers.

The stress of a cell is given at its vertices. Its multipliers are a velocity y of the cell, for
div σ + b = 0, and velocities w of each facet's vertices, for the tractions there. A vertex v has a
share 1/(d + 1) of the volume, and the strain rate

    e_v = (d + 1) Σ_{facets f at v} sym(∇φ_f ⊗ (y − w_fv)),

with the gradients ∇φ of barycentric coordinates, where facet f is opposite to vertex f. In space a
cell is split at its barycentre into four. A single tetrahedron does not carry all balanced linear
tractions, but the split one does (C. Johnson, B. Mercier, Numer. Math. 30 (1978), 103; M. Křížek,
Apl. Mat. 27 (1982), 46).
"""

import itertools
import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.mesh.straight_geometry import gradients


@dataclass(frozen=True)
class CellLayout:
    """Parts, vertices and multipliers of a cell; the multipliers of its own facets come first.

    Attributes:
        corners: Vertex of the cell at each vertex of each part, d + 1 for the barycentre, shape
            (num_parts, d + 1); in part a the barycentre replaces vertex a.
        rows: Multiplier of each component at each vertex of each part: of the part, then of the
            facets at the vertex, shape (num_parts, d + 1, d + 1, d).
        outer: Number of multipliers of the cell's own facets, d² per facet, in the order of the
            facet's vertices in the cell.
        inner: Number of all other multipliers.
    """

    corners: Longs
    rows: Longs
    outer: int
    inner: int


@lru_cache
def cell_layout(tdim: int) -> CellLayout:
    """Return the layout of a triangle (one part) or a tetrahedron (four)."""
    places = range(tdim + 1)
    centre, outer = tdim + 1, (tdim + 1) * tdim**2
    corners = np.array([list(places)])
    if tdim == 3:
        corners = np.array([[centre if v == a else v for v in places] for a in places])
    first: dict[tuple[int, ...], int] = {
        facet: tdim**2 * a for a, facet in enumerate(facets_of(tuple(places)))
    }
    count = outer
    for s in range(len(corners)):
        first[(s,)] = count  # multipliers of the part
        count += tdim
    rows = np.zeros((len(corners), tdim + 1, tdim + 1, tdim), dtype=np.int64)
    for s, v in itertools.product(range(len(corners)), places):
        rows[s, v, 0] = first[(s,)] + np.arange(tdim)
        for k, f in enumerate((f for f in places if f != v), start=1):
            facet = tuple(sorted(corners[s][[p for p in places if p != f]]))
            if facet not in first:
                first[facet] = count
                count += tdim**2
            rows[s, v, k] = first[facet] + tdim * facet.index(corners[s, v]) + np.arange(tdim)
    return CellLayout(corners, rows, outer, count - outer)


def facets_of(simplex: tuple[int, ...]) -> list[tuple[int, ...]]:
    """Return the vertices of the facet opposite each vertex."""
    return [tuple(b for b in simplex if b != a) for a in simplex]


@lru_cache
def tensors(gdim: int) -> Floats:
    """Return the unit tensor and orthonormal deviators, in plane strain the in-plane ones.

    Returns:
        Shape (1 + m, gdim, gdim), m = 2 or 5.
    """
    found = [np.eye(gdim)]
    for i in range(1, gdim):
        diagonal = np.diag([1.0] * i + [-float(i)] + [0.0] * (gdim - i - 1))
        found.append(diagonal / math.sqrt(i * (i + 1)))
    for i, j in itertools.combinations(range(gdim), 2):
        shear = np.zeros((gdim, gdim))
        shear[i, j] = shear[j, i] = 1 / math.sqrt(2)
        found.append(shear)
    return np.array(found)


@lru_cache
def components(gdim: int) -> Floats:
    """Return the Mandel components of :func:`tensors` in equations, shape (1 + m, 3 or 6).

    In the plane σ_zz is in no equation.
    """
    E = tensors(gdim)
    # Components that follow the diagonal ones in a Mandel vector, by dimension.
    off_diagonal = {2: ((0, 1),), 3: ((1, 2), (0, 2), (0, 1))}
    return np.stack(
        [E[:, i, i] for i in range(gdim)]
        + [math.sqrt(2) * E[:, i, j] for i, j in off_diagonal[gdim]],
        axis=1,
    )


def strain_matrices(x: Floats, axes: Floats) -> tuple[Floats, Floats]:
    """Return strain rates of multipliers, and the volumes of vertices.

    Args:
        x: Vertices of cells, shape (num_cells, d + 1, d).
        axes: Directions of the components of w on the cell's facets, shape (num_cells, d + 1, d,
            d); zero where a support holds one.

    Returns:
        Coefficients of trace and deviator (:func:`tensors`), shape (num_cells, num_points, (d + 1)
        d, 1 + m); points are all vertices of all parts in the order of ``rows``. Volumes, shape
        (num_cells, num_points).
    """
    tdim = x.shape[2]
    layout, E = cell_layout(tdim), tensors(tdim)
    places = np.concatenate([x, x.mean(axis=1, keepdims=True)], axis=1)
    slopes, volume = gradients(places[:, layout.corners])
    # E_j ∇φ_f of each part: the traction of E_j on its facet f, up to a factor
    pushes = -(tdim + 1) * np.einsum("jik,csfk->csfij", E, slopes)
    num_parts = len(layout.corners)
    matrices = np.empty((len(x), num_parts, tdim + 1, tdim + 1, tdim, len(E)))
    for s, v in itertools.product(range(num_parts), range(tdim + 1)):
        matrices[:, s, v, 0] = pushes[:, s, v]
        for k, f in enumerate((f for f in range(tdim + 1) if f != v), start=1):
            on_outside = layout.rows[s, v, k, 0] < layout.outer
            matrices[:, s, v, k] = axes[:, f] @ pushes[:, s, f] if on_outside else pushes[:, s, f]
    points = num_parts * (tdim + 1)
    shares = np.repeat(volume / (tdim + 1), tdim + 1, axis=1)
    return matrices.reshape(len(x), points, (tdim + 1) * tdim, len(E)), shares
