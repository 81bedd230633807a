"""Formulate cells of bodies of revolution: equilibrium of S = rσ, quadratic in the section.

Times r, the equations of equilibrium around an axis with a force b per volume are

    σ_θ = ∂_r S_rr + ∂_z S_rz + r b_r,   ∂_r S_rz + ∂_z S_zz + r b_z = 0.

Let the components of S, except S_θ, be quadratic in a cell with the Bernstein coefficients S_a at
vertices and S_ab at edges. Derivatives are linear, with the value 2 Σ_b ∇φ_b S_ab at the vertex a
(S_aa = S_a). So the second equation holds everywhere if it does at vertices, and σ_θ is linear.
Then S_θ = rσ_θ is quadratic with the coefficients r_a σ_θa and (r_a σ_θb + r_b σ_θa)/2. Bernstein's
polynomials are not negative. So S is within yield, ‖dev S‖ ≤ γr, if its coefficients are with those
of r: r_a and (r_a + r_b)/2. Tractions S·n on a facet are continuous if their three coefficients
are. Where a coefficient of r is zero, on the axis, that of S is zero too.

The unknowns of a coefficient are σ = S/r, and each is a point of the cell. The multipliers of a
cell are y_r for the six definitions of S_θ, y_z for its vertices, and the velocities of the facets,
three each. NumPy only.
"""

import math
from functools import lru_cache

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.facets.stress_cells import CellLayout
from perfplast_fenicsx.mesh.ring_polynomials import COEFFICIENTS, EDGES, coefficients_of_radius
from perfplast_fenicsx.mesh.straight_geometry import gradients

NODES = 3
"""Number of coefficients of a traction on a facet: at its ends in the order of the vertices, and
between them.
"""


@lru_cache
def ring_layout() -> CellLayout:
    """Return the layout of a section; each point has six y_r, three y_z and those of its facets."""
    outer = 3 * NODES * 2
    of_facet = np.arange(outer).reshape(3, NODES, 2)
    rows = np.empty((1, 6, 13), dtype=np.int64)
    rows[:, :, :9] = outer + np.arange(9)
    for v in range(3):
        rows[0, v, 9:] = np.concatenate([of_facet[f, k] for f, k in _ends_at(v)])
        # an edge belongs to one facet; the multipliers of the other facet do not act there
        rows[0, 3 + v, 9:] = np.concatenate([of_facet[v, 2], of_facet[(v + 1) % 3, 2]])
    return CellLayout(np.array([[0, 1, 2]]), rows, outer, 9)


def ring_matrices(x: Floats, axes: Floats) -> tuple[Floats, Floats]:
    """Return strain rates of multipliers, and the volumes of points for the full turn.

    Args:
        x: Vertices of cells, r and z, shape (num_cells, 3, 2).
        axes: Directions of the components of velocities on the cell's facets, shape (num_cells, 3,
            2, 2); zero where a support holds one.

    Returns:
        Coefficients of Mandel's components, shape (num_cells, 6, 13, 4), multipliers in the order
        of :func:`ring_layout`; volumes, shape (num_cells, 6). A point on the axis has only the
        multiplier that keeps its own σ_θ, which has no meaning, at zero.
    """
    slopes, areas = gradients(x)
    radii, rho = x[..., 0], coefficients_of_radius(x)
    off = rho > 0
    rings = np.where(off, rho, radii.max(axis=1, keepdims=True))
    tensors = np.zeros((4, 2, 2))  # in the section, for Mandel's components (rr, zz, θθ, √2 rz)
    tensors[[0, 1], [0, 1], [0, 1]] = 1.0
    tensors[3, [0, 1], [1, 0]] = math.sqrt(0.5)
    hoop = 2
    pushes = np.einsum("jik,cfk->cfij", tensors, slopes)  # E_j ∇φ_f
    found = np.zeros((len(x), 6, 13, len(tensors)))
    for a in range(3):
        for b in range(3):
            point = COEFFICIENTS[a, b]
            found[:, point, 6 + a] -= 2 * pushes[:, b, 1]
            of_hoop = -2 * pushes[:, b, 0]  # part of σ_θ at the vertex a
            found[:, point, a] += of_hoop * off[:, a, None]
            for c in (c for c in range(3) if c != a):
                edge = COEFFICIENTS[a, c]
                share = np.where(off[:, edge], radii[:, c] / (2 * rings[:, edge]), 0.0)
                found[:, point, edge] += share[:, None] * of_hoop
    for v in range(3):
        for k, (f, _) in enumerate(_ends_at(v)):
            found[:, v, 9 + 2 * k : 11 + 2 * k] = -4 * axes[:, f] @ pushes[:, f]
        found[:, 3 + v, 9:11] = -4 * axes[:, v] @ pushes[:, v]
    found *= off[:, :, None, None]
    for i in range(6):
        found[:, i, i, hoop] = 1 / rings[:, i]
    return found, 2 * math.pi * rings * areas[:, None] / 6


def ring_forces(x: Floats, forces: Floats) -> Floats:
    """Return the loads of the cells' multipliers by forces per volume, shape (num_cells, 9)."""
    _, areas = gradients(x)
    radii, rho = x[..., 0], coefficients_of_radius(x)
    ends = np.array(EDGES)
    outward = np.concatenate([radii, radii[:, ends].prod(axis=2)], axis=1)
    np.divide(outward[:, 3:], rho[:, 3:], out=outward[:, 3:], where=rho[:, 3:] > 0)
    share = math.pi / 3 * areas[:, None]
    return share * np.hstack([outward * forces[:, :1], radii * forces[:, 1:]])


def on_facets(values: Floats, radii: Floats) -> Floats:
    """Return coefficients of r times a linear function on facets; the third is between the ends.

    Args:
        values: Values of the function at the ends, shape (..., 2, k).
        radii: Radii r of the ends, shape (..., 2).

    Returns:
        Shape (..., 3, k).
    """
    first, last = values[..., 0, :], values[..., 1, :]
    r, s = radii[..., :1], radii[..., 1:]
    return np.stack([r * first, s * last, (r * last + s * first) / 2], axis=-2)


def _ends_at(vertex: int) -> list[tuple[int, int]]:
    """Return the facets at a vertex, and its index among the ends of each."""
    return [(f, EDGES[f].index(vertex)) for f in range(3) if f != vertex]
