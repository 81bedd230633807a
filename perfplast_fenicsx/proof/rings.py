"""Bodies of revolution: what their sections say of stresses S = rσ and velocities v = ru.

Cells are triangles of r and z. Quadratics have Bernstein's coefficients at the vertices and at the
edges 01, 02, 12; the polynomials are not negative, and add up to 1. All works are over 2π.

- S is quadratic. Around an axis with the force b per volume σ_θ = ∂_r S_rr + ∂_z S_rz + r b_r,
  which is linear, and ∂_r S_rz + ∂_z S_zz + r b_z = 0, so that it is enough to look at vertices.
  ‖MS‖ + q·S ≤ cr everywhere if the coefficients keep to it. On the axis S is zero.
- v is quadratic and zero on the axis, and r²ε is quadratic, too. What is dissipated, D(ε), is
  convex and of first degree: ∫ D(ε) r ≤ Σ D(q_i) ∫ B_i/r with the coefficients q_i of r²ε.
"""

from functools import lru_cache

import numpy as np

from perfplast_fenicsx.proof.body import Body, Floats, Longs
from perfplast_fenicsx.proof.load_kinds import Loads

PAIRS = np.array([[0, 3, 4], [3, 1, 5], [4, 5, 2]])
"""Number of the coefficient of two vertices."""

ENDS = np.array([[0, 1], [0, 2], [1, 2]])
"""Vertices of the edges."""


def normals_of(body: Body) -> int:
    """Return how many components of a stress, the first, are normal ones."""
    return 3 if body.is_revolved else body.dim


def around(body: Body) -> Floats:
    """Return the measure of the middle of each cell out of its plane: 2πr, or 1."""
    if not body.is_revolved:
        return np.ones(len(body.cells))
    return np.asarray(2 * np.pi * radii_of(body).mean(axis=1))


def radii_of(body: Body) -> Floats:
    """R at the vertices of each cell."""
    return np.asarray(body.vertices[body.cells][..., 0])


def times_radius(radii: Floats, values: Floats) -> Floats:
    """Return coefficients of r times what is linear, in cells or on facets.

    Args:
        radii: At the vertices, shape (n, k).
        values: The same, shape (n, k, m).

    Returns:
        Those at vertices, then those at edges, shape (n, k + k(k − 1)/2, m).
    """
    a, b = (ENDS if radii.shape[1] == 3 else ENDS[:1]).T
    between = radii[:, a, None] * values[:, b] + radii[:, b, None] * values[:, a]
    return np.concatenate([radii[..., None] * values, between / 2], axis=1)


def coefficients_of_radius(radii: Floats) -> Floats:
    """Return those of r, shape (n, 6) of (n, 3), or (n, 3) of (n, 2)."""
    return times_radius(radii, np.ones((*radii.shape, 1)))[..., 0]


def applied(body: Body, loads: Loads) -> Floats:
    """Return tractions of loads at the vertices of facets, or coefficients of r times these."""
    if not body.is_revolved:
        return loads.traction
    return times_radius(body.vertices[body.facets][..., 0], loads.traction)


def derivatives(body: Body, coefficients: Floats) -> Floats:
    """At vertices, shape (num_cells, 3, m, 2), of quadratics of shape (num_cells, 6, m)."""
    return np.asarray(
        2 * np.einsum("cbk,cabm->camk", body.gradients, coefficients[:, PAIRS], optimize=True)
    )


def whole_stress(body: Body, stress: Floats, force: Floats) -> tuple[Floats, Floats]:
    """S with S_θ = rσ_θ, and what is left of equilibrium along the axis.

    Args:
        body: The bodies.
        stress: Coefficients in the section, shape (num_cells, 6, 2, 2).
        force: Per volume, shape (num_cells, 2).

    Returns:
        Vectors (rr, zz, θθ, √2 rz), shape (num_cells, 6, 4); a stress over a length times r at
        vertices, shape (num_cells, 3).
    """
    radii = radii_of(body)
    grad = derivatives(body, stress.reshape(len(stress), 6, 4)).reshape(-1, 3, 2, 2, 2)
    rates = np.einsum("caikk->cai", grad) + radii[..., None] * force[:, None]
    hoop = times_radius(radii, rates[..., :1])[..., 0]
    shear = np.sqrt(0.5) * (stress[..., 0, 1] + stress[..., 1, 0])
    return np.stack([stress[..., 0, 0], stress[..., 1, 1], hoop, shear], axis=2), rates[..., 1]


def bernstein(v: Floats) -> Floats:
    """Return coefficients of quadratics from their values at vertices and middles of edges."""
    found = v.copy()
    found[:, 3:] = 2 * v[:, 3:] - v[:, ENDS].mean(axis=2)
    return found


@lru_cache
def _means() -> Floats:
    """Return means of products of Bernstein's polynomials and linear ones, shape (6, 3)."""
    of_edges = [[2 if a in ends else 1 for a in range(3)] for ends in ENDS]
    return np.concatenate([1 + 2 * np.eye(3), of_edges]) / 30


def over_radius(radii: Floats, areas: Floats) -> Floats:
    """∫ B_i/r over triangles, from above; 0 of coefficients of r²ε that are zero on the axis.

    1/r is convex, and at most linear between its values at vertices. With one vertex on the axis it
    is so along the edge opposite, over the distance from that vertex. With two, r²ε is r times what
    is linear, and the norm of that at most linear between its values at vertices.

    Args:
        radii: At the vertices, shape (n, 3).
        areas: Shape (n,).
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
    """The largest of values at vertices and edges of cells where r is zero, which are to be zero.

    Args:
        body: The bodies.
        values: Shape (num_cells, 6, ...).
    """
    there = coefficients_of_radius(radii_of(body)) == 0
    return float(np.abs(values[there]).max(initial=0))


def speed_of(body: Body, v: Floats) -> float:
    """Return the largest velocity u = v/r is at most that of the coefficients."""
    rho = coefficients_of_radius(radii_of(body))
    sizes = np.abs(bernstein(v)).max(axis=2)
    return float((sizes[rho > 0] / rho[rho > 0]).max(initial=0))


def facet_coefficients(body: Body, sides: Longs) -> Longs:
    """Numbers of the coefficients of sides: both ends by the number of the vertex, and the edge."""
    cells, places = sides // 3, body.corners[sides % 3]
    numbers = np.take_along_axis(body.cells[cells], places, axis=1)
    places = np.take_along_axis(places, np.argsort(numbers, axis=1), axis=1)
    return np.column_stack([places, PAIRS[places[:, 0], places[:, 1]]])
