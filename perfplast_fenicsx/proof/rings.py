"""Describe bodies of revolution by their sections, with stresses S = rσ and velocities v = ru.

Cells are triangles in the coordinates r and z. Quadratic functions have Bernstein coefficients at
the vertices and at the edges 01, 02, 12; Bernstein polynomials are non-negative and sum to 1. All
works are divided by 2π.

- S is quadratic. With the force b per volume, σ_θ = ∂_r S_rr + ∂_z S_rz + r b_r is linear. Axial
  equilibrium is ∂_r S_rz + ∂_z S_zz + r b_z = 0, which needs checks at vertices only. The condition
  ‖MS‖ + q·S ≤ cr holds everywhere if it holds for the coefficients. On the axis S is zero.
- v is quadratic and zero on the axis, and r²ε is quadratic too. The dissipation D(ε) is convex and
  homogeneous of degree 1, and therefore ∫ D(ε) r ≤ Σ D(q_i) ∫ B_i/r with the coefficients q_i of
  r²ε and the Bernstein polynomials B_i.
"""

from functools import lru_cache

import numpy as np

from perfplast_fenicsx.proof.body import Body, Floats, Longs
from perfplast_fenicsx.proof.load_kinds import Loads

PAIRS = np.array([[0, 3, 4], [3, 1, 5], [4, 5, 2]])
"""Index of the coefficient for each pair of vertices."""

ENDS = np.array([[0, 1], [0, 2], [1, 2]])
"""Indices of the vertices at the ends of the edges."""


def normals_of(body: Body) -> int:
    """Return the number of normal components of a stress, which come first in a vector."""
    return 3 if body.is_revolved else body.dim


def around(body: Body) -> Floats:
    """Return the out-of-plane measure at the middle of each cell: 2πr for rings, otherwise 1."""
    if not body.is_revolved:
        return np.ones(len(body.cells))
    return np.asarray(2 * np.pi * radii_of(body).mean(axis=1))


def radii_of(body: Body) -> Floats:
    """Return r at the vertices of each cell."""
    return np.asarray(body.vertices[body.cells][..., 0])


def times_radius(radii: Floats, values: Floats) -> Floats:
    """Return coefficients of r times linear functions, in cells or on facets.

    Args:
        radii: Radii at the vertices, shape (n, k).
        values: Values at the vertices, shape (n, k, m).

    Returns:
        Coefficients at vertices, then at edges, shape (n, k + k(k − 1)/2, m).
    """
    a, b = (ENDS if radii.shape[1] == 3 else ENDS[:1]).T
    between = radii[:, a, None] * values[:, b] + radii[:, b, None] * values[:, a]
    return np.concatenate([radii[..., None] * values, between / 2], axis=1)


def coefficients_of_radius(radii: Floats) -> Floats:
    """Return the coefficients of r, shape (n, 6) from (n, 3), or (n, 3) from (n, 2)."""
    return times_radius(radii, np.ones((*radii.shape, 1)))[..., 0]


def applied(body: Body, loads: Loads) -> Floats:
    """Return load tractions at facet vertices; for rings, coefficients of r times tractions."""
    if not body.is_revolved:
        return loads.traction
    return times_radius(body.vertices[body.facets][..., 0], loads.traction)


def derivatives(body: Body, coefficients: Floats) -> Floats:
    """Return derivatives at vertices, shape (num_cells, 3, m, 2) from (num_cells, 6, m)."""
    return np.asarray(
        2 * np.einsum("cbk,cabm->camk", body.gradients, coefficients[:, PAIRS], optimize=True)
    )


def whole_stress(body: Body, stress: Floats, force: Floats) -> tuple[Floats, Floats]:
    """Return S with its hoop component S_θ = rσ_θ, and the residual of axial equilibrium.

    Args:
        body: The bodies.
        stress: Coefficients of S in the section plane, shape (num_cells, 6, 2, 2).
        force: Force per volume, shape (num_cells, 2).

    Returns:
        Vectors (rr, zz, θθ, √2 rz), shape (num_cells, 6, 4), and the residual at vertices, shape
        (num_cells, 3). The residual is r times a stress over a length.
    """
    radii = radii_of(body)
    grad = derivatives(body, stress.reshape(len(stress), 6, 4)).reshape(-1, 3, 2, 2, 2)
    rates = np.einsum("caikk->cai", grad) + radii[..., None] * force[:, None]
    hoop = times_radius(radii, rates[..., :1])[..., 0]
    shear = np.sqrt(0.5) * (stress[..., 0, 1] + stress[..., 1, 0])
    return np.stack([stress[..., 0, 0], stress[..., 1, 1], hoop, shear], axis=2), rates[..., 1]


@lru_cache
def _means() -> Floats:
    """Return the means of quadratic times linear Bernstein polynomials, shape (6, 3)."""
    of_edges = [[2 if a in ends else 1 for a in range(3)] for ends in ENDS]
    return np.concatenate([1 + 2 * np.eye(3), of_edges]) / 30


def over_radius(radii: Floats, areas: Floats) -> Floats:
    """Return upper bounds on ∫ B_i/r over triangles.

    The bound is 0 for coefficients of r²ε that are zero on the axis. Because 1/r is convex, it is
    at most the linear interpolation of its values at vertices. In a triangle with one vertex on the
    axis, 1/r has this bound on the opposite edge, and elsewhere the bound is divided by the
    relative distance from the vertex. In a triangle with two vertices on the axis, r²ε is r times a
    linear function, whose norm is at most the linear interpolation of its values at vertices.

    Args:
        radii: Radii at the vertices, shape (n, 3).
        areas: Areas, shape (n,).
    """
    none = radii == 0
    inverse = np.divide(1.0, radii, out=np.zeros_like(radii), where=~none)
    found = inverse @ _means().T
    for a in range(3):
        b, c = (k for k in range(3) if k != a)
        alone = none[:, a] & ~none[:, b] & ~none[:, c]
        s, t = inverse[alone][:, [b, c]].T
        rows = np.zeros((len(s), 6))
        rows[:, b], rows[:, c] = s / 6 + t / 18, s / 18 + t / 6
        rows[:, PAIRS[b, c]] = (s + t) / 9
        rows[:, PAIRS[a, b]], rows[:, PAIRS[a, c]] = (2 * s + t) / 9, (s + 2 * t) / 9
        found[alone] = rows
        edge = none[:, b] & none[:, c]
        rows = np.zeros((int(edge.sum()), 6))
        rows[:, a] = inverse[edge, a] / 3
        rows[:, PAIRS[a, [b, c]]] = 2 * inverse[edge, a, None] / 3
        found[edge] = rows
    return np.asarray(found * areas[:, None])


def on_axis(body: Body, values: Floats) -> float:
    """Return the largest |value| at vertices and edges on the axis, where values must be zero.

    Args:
        body: The bodies.
        values: Values, shape (num_cells, 6, ...).
    """
    there = coefficients_of_radius(radii_of(body)) == 0
    return float(np.abs(values[there]).max(initial=0))


def facet_coefficients(body: Body, sides: Longs) -> Longs:
    """Return coefficient indices of sides: the ends, sorted by vertex number, then the edge."""
    cells, places = sides // 3, body.corners[sides % 3]
    numbers = np.take_along_axis(body.cells[cells], places, axis=1)
    places = np.take_along_axis(places, np.argsort(numbers, axis=1), axis=1)
    return np.column_stack([places, PAIRS[places[:, 0], places[:, 1]]])
