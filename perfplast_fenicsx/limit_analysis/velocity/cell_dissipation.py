"""Compute upper bounds of the dissipation of cells with linear strain rates.

‖·‖ is convex, so its integral is at most that of its linear interpolation on any subdivision of the
cell (the composite vertex rule). The same holds for Σ|ε_i| of the principal values. A body that
dilates dissipates (γ/α) tr ε, which is linear. A linear function that is nowhere below replaces a
strength that varies; its product with a linear function is integrated exactly.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from itertools import permutations, product

import numpy as np

from perfplast_fenicsx.arrays import Floats, Ints, Longs
from perfplast_fenicsx.compat import interpolation_points
from perfplast_fenicsx.limit_analysis.conic.semidefinite_cones import PrincipalCones
from perfplast_fenicsx.limit_analysis.discrete.ring_strains import has_coefficients
from perfplast_fenicsx.limit_analysis.velocity.mechanism_rates import MechanismRates
from perfplast_fenicsx.problem.problem import Problem

SUBDIVISIONS = 8
"""Number of parts of a cell's edge in the composite vertex rule."""


def points_of_cells(problem: Problem) -> Ints:
    """Return the points of the cells that this rank owns, shape (num_cells, num_points)."""
    topology = problem.tagged_mesh.mesh.topology
    points: Ints = problem.Q.dofmap.list[: topology.index_map(topology.dim).size_local]
    return points


def at_vertices(problem: Problem, values: Floats) -> Floats:
    """Return values at vertices of functions that are linear in each cell and given at the points.

    Args:
        problem: The problem of the points.
        values: Values at the points, shape (count, m).

    Returns:
        Shape (num_cells, d + 1, m), for the cells that this rank owns. If the points are Bernstein
        coefficients (:mod:`ring_strains`), they are returned, shape (num_cells, 6, m).
    """
    given = values[points_of_cells(problem)]
    if has_coefficients(problem):
        return given
    reference = interpolation_points(problem.S.element)
    if problem.degree == 1:
        return np.repeat(given, reference.shape[1] + 1, axis=1)
    places = np.hstack([1 - reference.sum(axis=1, keepdims=True), reference])
    found: Floats = np.einsum("vp,cpi->cvi", np.linalg.inv(places), given)
    return found


def missing_growth(problem: Problem, rates: MechanismRates) -> Floats:
    """Return the shortfall of tr ε from α‖dev ε‖ at the vertices of dilating bodies.

    Not collective.

    Args:
        problem: The bodies.
        rates: Rates that are linear in each cell.

    Returns:
        Shape (num_cells, d + 1), or of coefficients (num_cells, 6), for the cells that this rank
        owns.
    """
    slopes = rates.slopes[points_of_cells(problem)][:, :1]
    there = at_vertices(problem, np.column_stack([rates.trace, rates.deviator]))
    needed = slopes * np.linalg.norm(there[..., 1:], axis=2)
    missing: Floats = np.where(slopes > 0, np.maximum(needed - there[..., 0], 0.0), 0.0)
    cones, here = principal_of_cells(problem, rates)
    count = there.shape[1]
    for vertex in range(count if cones.count else 0):
        missing[here, vertex] = cones.lacking(there[here, vertex, 0], there[here, vertex, 1:])
    return missing


def principal_of_cells(problem: Problem, rates: MechanismRates) -> tuple[PrincipalCones, Longs]:
    """Return the bounds of principal stresses of cells, and the numbers of these cells.

    Args:
        problem: The bodies.
        rates: Rates at the points of the problem.

    Returns:
        The bounds, with ``at`` 0, 1, ... and without the profile of the strength; numbers of the
        cells that this rank owns.
    """
    first, given = points_of_cells(problem)[:, 0], rates.principal
    if rates.profile is not None:
        given = given.scaled(1 / rates.profile)
    at_points = np.full(rates.count, -1)
    at_points[given.at] = np.arange(given.count)
    numbers = at_points[first]
    here = np.flatnonzero(numbers >= 0)
    some = numbers[here]
    places: Longs = np.arange(len(here))
    return replace(given.those(some), at=places), here


def dissipation_of_cells(
    problem: Problem, rates: MechanismRates, subdivisions: int = SUBDIVISIONS
) -> Floats:
    """Return upper bounds of the dissipation of cells, in the coordinates of their cones.

    Not collective. The dissipation is ∫ γ(‖dev ε‖ − t·dev ε), or ∫ (γ/α) tr ε in dilating bodies
    (:mod:`standard_cones`). For bounds of principal stresses see :mod:`semidefinite_cones`. A
    volume change that is too small for its deviator by rounding counts as admissible.

    Args:
        problem: The bodies.
        rates: Rates that are linear in each cell.
        subdivisions: Parts of a cell's edge.

    Returns:
        Shape (num_cells,), for the cells that this rank owns.
    """
    points = points_of_cells(problem)
    radii = np.where(np.isfinite(rates.radii), rates.radii, 0.0)
    if rates.profile is not None:
        radii = radii / rates.profile
    volumes = rates.weights[points].sum(axis=1)
    scaled = at_vertices(problem, rates.deviator * radii[:, None])
    powers = work_of_cells(volumes, scaled, subdivisions, rates.above)
    if rates.tilts is not None:
        along = (scaled * at_vertices(problem, rates.tilts)).sum(axis=2)
        powers -= volumes * _mean(along, rates.above)
    slopes = rates.slopes[points][:, 0]
    if (dilating := slopes > 0).any():
        growth = at_vertices(problem, rates.trace[:, None])[..., 0]
        growth += missing_growth(problem, rates)
        linear = radii[points][:, 0] * volumes * _mean(growth, rates.above)
        powers[dilating] = linear[dilating] / slopes[dilating]
    cones, here = principal_of_cells(problem, rates)
    if cones.count:
        above = None if rates.above is None else rates.above[here]
        missing = _mean(missing_growth(problem, rates)[here], above)
        powers[here] = _of_principal(problem, rates, cones, here, subdivisions)
        powers[here] += volumes[here] * sum(map(np.abs, cones.factors)) * missing
    return powers


def _mean(values: Floats, profile: Floats | None) -> Floats:
    """Return the means in cells of linear functions, times the profile of the strength if any.

    Args:
        values: Values at the vertices, shape (num_cells, d + 1).
        profile: Profile at the vertices, same shape.
    """
    if profile is None:
        return np.asarray(values.mean(axis=1))
    n = values.shape[1]
    sums = np.einsum("cv,cv->c", values, profile) + values.sum(axis=1) * profile.sum(axis=1)
    return np.asarray(sums / (n * (n + 1)))


def _of_principal(
    problem: Problem, rates: MechanismRates, cones: PrincipalCones, here: Longs, subdivisions: int
) -> Floats:
    """Return the dissipation of cells with cones of principal stresses.

    Args:
        problem: The bodies.
        rates: Rates that are linear in each cell.
        cones: Cones of these cells.
        here: Numbers of these cells.
        subdivisions: Parts of a cell's edge.
    """
    there = at_vertices(problem, np.column_stack([rates.trace, rates.deviator]))[here]
    volumes = rates.weights[points_of_cells(problem)[here]].sum(axis=1)
    of_trace, of_sizes = cones.factors
    above = None if rates.above is None else rates.above[here]
    found: Floats = of_trace * volumes * _mean(there[..., 0], above)
    if of_sizes.any():
        sizes = work_of_cells(
            volumes, there, subdivisions, above, lambda some: cones.sizes(some[:, 0], some[:, 1:])
        )
        found += of_sizes * sizes
    return found


def work_of_cells(
    volumes: Floats,
    vertex_values: Floats,
    subdivisions: int,
    profile: Floats | None = None,
    size: Callable[[Floats], Floats] = lambda values: np.linalg.norm(values, axis=1),
) -> Floats:
    """Return an upper bound of ∫ f‖s‖ in each cell, for s and f linear in it.

    Args:
        volumes: Volumes of the cells, shape (num_cells,).
        vertex_values: Values s at the vertices, shape (num_cells, d + 1, m).
        subdivisions: Parts of a cell's edge.
        profile: Factor f ≥ 0 at the vertices, shape (num_cells, d + 1); None for 1.
        size: Norm ‖·‖, or another convex function of s: shape (num_cells,) for (num_cells, m).

    Returns:
        Shape (num_cells,).
    """
    points, shares = composite_vertex_rule(vertex_values.shape[1] - 1, subdivisions)
    weights = shares.sum(axis=1)[:, None] if profile is None else shares @ profile.T
    total: Floats = np.zeros(len(volumes))
    for point, weight in zip(points, weights, strict=True):
        total += weight * size(np.einsum("v,cvi->ci", point, vertex_values))
    return total * volumes


@lru_cache
def composite_vertex_rule(tdim: int, n: int) -> tuple[Floats, Floats]:
    """Return points and shares of the vertex rule on n^tdim equal parts of a simplex.

    The parts are those of Kuhn's division of cubes that lie in the simplex 1 ≥ x₁ ≥ x₂ ≥ ... ≥ 0.

    Returns:
        Barycentric coordinates, shape (num_points, tdim + 1), and shares of the volume, of the
        same shape. A share is the integral of the hat function of a point times a barycentric
        coordinate, over the volume. They add up to 1.
    """
    corners = []
    for corner in product(range(n), repeat=tdim):
        for axes in permutations(range(tdim)):
            steps = np.zeros((tdim + 1, tdim), dtype=int)
            for k, axis in enumerate(axes):
                steps[k + 1 :, axis] += 1
            simplex = np.array(corner) + steps
            if (np.diff(simplex, axis=1) <= 0).all():
                corners.append(simplex)
    grid, inverse = np.unique(np.concatenate(corners), axis=0, return_inverse=True)
    ends = np.hstack([np.full((len(grid), 1), n), grid, np.zeros((len(grid), 1), dtype=int)])
    points = -np.diff(ends, axis=1) / n
    parts = inverse.reshape(-1, tdim + 1)
    # the integral of λ_k λ_l over a part is (1 + δ_kl)/((d + 1)(d + 2)) of its volume
    of_parts = points[parts]
    moments = of_parts + of_parts.sum(axis=1, keepdims=True)
    shares = np.zeros_like(points)
    np.add.at(shares, parts, moments / ((tdim + 1) * (tdim + 2) * len(parts)))
    return points, shares
