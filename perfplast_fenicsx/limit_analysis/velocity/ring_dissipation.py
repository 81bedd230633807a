"""Dissipation of bodies of revolution by v = ru that is quadratic in each cell, from above.

Of the strain rates ε of u, r²ε is quadratic in the section,

    (r ∂_r v_r − v_r, r ∂_z v_z, v_r, (r ∂_z v_r + r ∂_r v_z − v_z)/√2)   (rr, zz, θθ, √2 rz),

and with its Bernstein coefficients q_i on a part of a cell ∫ ‖ε‖ r ≤ Σ ‖q_i‖ ∫ B_i/r, as ‖·‖ is
convex and B_i ≥ 0. There 1/r, convex too, is at most linear between its values at vertices. On a
part with an edge on the axis q = r times what is linear, and in one with a vertex there 1/r is at
most linear along the edge opposite, divided by the distance from that vertex. NumPy only but for
the cells' laws.
"""

import math
from itertools import product

import numpy as np
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.discrete.body_cones import BodyCones, body_cones
from perfplast_fenicsx.limit_analysis.facets.ring_cells import (
    COEFFICIENTS,
    EDGES,
    coefficients_of_product,
    means,
    of_parts,
)
from perfplast_fenicsx.mesh.straight_geometry import corners, gradients
from perfplast_fenicsx.problem.problem import Problem


def ring_rates(x: Floats, v: Floats) -> Floats:
    """Return coefficients of r²ε, Mandel vectors, shape (num_cells, 6, 4).

    Args:
        x: Vertices of cells, shape (num_cells, 3, 2).
        v: At vertices and between, in the order of :data:`ring_cells.EDGES`, (num_cells, 6, 2).
    """
    ends = np.array(EDGES)
    bernstein = v.copy()
    bernstein[:, 3:] = 2 * v[:, 3:] - v[:, ends].mean(axis=2)
    slopes, _ = gradients(x)
    # ∂_k v_i at vertices
    grad = 2 * np.einsum("cbk,cabi->caik", slopes, bernstein[:, COEFFICIENTS])
    r_grad = coefficients_of_product(x[..., 0], grad.reshape(len(x), 3, 4)).reshape(-1, 6, 2, 2)
    shear = r_grad[..., 0, 1] + r_grad[..., 1, 0] - bernstein[..., 1]
    return np.stack(
        [
            r_grad[..., 0, 0] - bernstein[..., 0],
            r_grad[..., 1, 1],
            bernstein[..., 0],
            math.sqrt(0.5) * shear,
        ],
        axis=2,
    )


def weights_of_rates(radii: Floats, areas: Floats) -> Floats:
    """∫ B_i/r over triangles, from above, and 0 where q_i is zero on the axis.

    Args:
        radii: At their vertices, shape (n, 3).
        areas: Shape (n,).

    Returns:
        Shape (n, 6).
    """
    on_axis = radii == 0
    inverse = np.divide(1.0, radii, out=np.zeros_like(radii), where=~on_axis)
    weights = inverse @ means().T
    for a, (b, c) in enumerate(EDGES):
        ab, ac = COEFFICIENTS[a, [b, c]]
        at_vertex = on_axis[:, a] & (on_axis.sum(axis=1) == 1)
        r, s = inverse[at_vertex][:, [b, c]].T / 36
        found = np.zeros((len(r), 6))
        found[:, b], found[:, c], found[:, 3 + a] = 6 * r + 2 * s, 2 * r + 6 * s, 4 * (r + s)
        found[:, ab], found[:, ac] = 8 * r + 4 * s, 4 * r + 8 * s
        weights[at_vertex] = found
        on_edge = on_axis[:, b] & on_axis[:, c]
        share = inverse[on_edge, a] / 3
        found = np.zeros((len(share), 6))
        found[:, a], found[:, ab], found[:, ac] = share, 2 * share, 2 * share
        weights[on_edge] = found
    return np.asarray(areas[:, None] * weights)


def dissipation_of_rings(problem: Problem, velocity: fem.Function, subdivisions: int) -> Floats:
    """Return the dissipation of cells from above. Not collective.

    Args:
        problem: By v = ru (:mod:`ring_flux`), of bodies that keep their volume.
        velocity: v, its ghosts up to date.
        subdivisions: Parts of a cell's edge.

    Returns:
        Shape (num_cells,), for the cells that this rank owns.
    """
    x, v = _values(problem, velocity)
    rates = ring_rates(x, v)
    _, areas = gradients(x)
    cones = body_cones(problem)
    total: Floats = np.zeros(len(x))
    parts = _parts(subdivisions)
    for part in parts:
        q = of_parts(rates, np.broadcast_to(part, (len(x), 3, 3)))
        weights = weights_of_rates(x[..., 0] @ part.T, areas / len(parts))
        total += np.einsum("ci,ci->c", weights, _powers(cones, q))
    return 2 * math.pi * total


def _values(problem: Problem, velocity: fem.Function) -> tuple[Floats, Floats]:
    """Return vertices of owned cells, and values at these and between them."""
    cells, points = corners(problem.tagged_mesh.mesh)
    layout, nodes = problem.V.dofmap.dof_layout, problem.V.dofmap.list[: len(cells)]
    columns = [layout.entity_dofs(0, i)[0] for i in range(3)]
    columns += [layout.entity_dofs(1, i)[0] for i in range(3)]  # the edge opposite each vertex
    v: Floats = velocity.x.array.reshape(-1, 2)[nodes[:, columns]]
    return points[cells], v


def _powers(cones: BodyCones, rates: Floats) -> Floats:
    """Return the dissipation of rates per volume, convex in them; shape (num_cells, 6)."""
    found = np.zeros(rates.shape[:2])
    for number, cone in enumerate(cones.cones):
        here, form = cones.of_cells == number, cone.standard
        if not cone.yields:
            continue
        deviator = (rates[here] @ form.frame)[..., 1:]
        if cone.principal is not None:
            flat = deviator.reshape(-1, deviator.shape[2])
            sets = cones.principal_at(np.full(len(flat), number))
            sizes = sets.sizes(np.zeros(len(flat)), flat) * cone.principal.bound / 2
            found[here] = sizes.reshape(deviator.shape[:2])
        else:
            sizes = np.linalg.norm(deviator, axis=2) - deviator @ form.tilt
            found[here] = form.radius * sizes
    return found


def _parts(count: int) -> list[Floats]:
    """Barycentric coordinates of equal parts of a triangle, exactly 0 on its edges."""
    parts = []
    for i, j in product(range(count), repeat=2):
        low = np.array([[i, j], [i + 1, j], [i, j + 1]])
        high = np.array([[i + 1, j], [i + 1, j + 1], [i, j + 1]])
        for part in (low, high):
            if part.sum(axis=1).max() <= count:
                first = count - part.sum(axis=1, keepdims=True)
                parts.append(np.hstack([first, part]) / count)
    return parts
