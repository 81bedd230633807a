"""Compute upper bounds of the dissipation of bodies of revolution, for quadratic v = ru.

For the strain rates ε of u, r²ε is quadratic in the section,

    (r ∂_r v_r − v_r, r ∂_z v_z, v_r, (r ∂_z v_r + r ∂_r v_z − v_z)/√2)   (rr, zz, θθ, √2 rz).

With its Bernstein coefficients q_i on a part of a cell ∫ ‖ε‖ r ≤ Σ ‖q_i‖ ∫ B_i/r, as ‖·‖ is convex
and B_i ≥ 0. There 1/r, convex too, is at most linear between its values at vertices. On a part with
an edge on the axis, q is r times a linear function. On a part with a vertex there, 1/r is at most
linear along the opposite edge, divided by the distance from that vertex. NumPy only, except for the
cells' laws.
"""

import math

import numpy as np
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.discrete.body_cones import BodyCones, body_cones
from perfplast_fenicsx.limit_analysis.discrete.ring_strains import nodes_of_cells
from perfplast_fenicsx.mesh.ring_polynomials import (
    equal_parts,
    of_parts,
    ring_rates,
    weights_of_rates,
)
from perfplast_fenicsx.mesh.straight_geometry import corners, gradients
from perfplast_fenicsx.problem.problem import Problem


def dissipation_of_rings(problem: Problem, velocity: fem.Function, subdivisions: int) -> Floats:
    """Return upper bounds of the dissipation of cells. Not collective.

    Args:
        problem: Problem in v = ru (:mod:`ring_flux`).
        velocity: Velocity v with updated ghosts.
        subdivisions: Parts of a cell's edge.

    Returns:
        Shape (num_cells,), for the cells that this rank owns.
    """
    x, v = _values(problem, velocity)
    rates = ring_rates(x, v)
    _, areas = gradients(x)
    cones = body_cones(problem)
    total: Floats = np.zeros(len(x))
    parts = equal_parts(subdivisions)
    for part in parts:
        q = of_parts(rates, np.broadcast_to(part, (len(x), 3, 3)))
        weights = weights_of_rates(x[..., 0] @ part.T, areas / len(parts))
        total += np.einsum("ci,ci->c", weights, _powers(cones, q))
    return 2 * math.pi * total


def _values(problem: Problem, velocity: fem.Function) -> tuple[Floats, Floats]:
    """Return vertices of owned cells, and the values at vertices and between them."""
    cells, points = corners(problem.tagged_mesh.mesh)
    nodes, _ = nodes_of_cells(problem, len(cells))
    v: Floats = velocity.x.array.reshape(-1, 2)[nodes]
    return points[cells], v


def _powers(cones: BodyCones, rates: Floats) -> Floats:
    """Return the dissipation of rates per volume, convex in them; shape (num_cells, 6).

    A dilation that is too small for its deviator by rounding is replaced by the least admissible
    one.
    """
    found = np.zeros(rates.shape[:2])
    for number, cone in enumerate(cones.cones):
        here, form = cones.of_cells == number, cone.standard
        if not cone.yields:
            continue
        turned = rates[here] @ form.frame
        trace, deviator = turned[..., 0], turned[..., 1:]
        if cone.principal is not None:
            flat, sums = deviator.reshape(-1, deviator.shape[2]), trace.ravel()
            sets = cones.principal_at(np.full(len(flat), number))
            more = sum(map(np.abs, sets.factors)) * sets.lacking(sums, flat) * sets.grows
            found[here] = (sets.powers(sums * sets.grows, flat) + more).reshape(trace.shape)
        elif form.slope > 0:
            needed = form.slope * np.linalg.norm(deviator, axis=2)
            found[here] = form.radius / form.slope * np.maximum(trace, needed)
        else:
            sizes = np.linalg.norm(deviator, axis=2) - deviator @ form.tilt
            found[here] = form.radius * sizes
    return found
