"""Dissipation of cells at strain rates that are linear in them, from above.

‖·‖ is convex, so that its integral is at most that of its linear interpolation on any subdivision
of the cell (the composite vertex rule), and so is Σ|ε_i| of the principal values. A body that
dilates dissipates (γ/α) tr ε, which is linear.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from itertools import permutations, product

import numpy as np

from perfplast_fenicsx.arrays import Floats, Ints, Longs
from perfplast_fenicsx.compat import interpolation_points
from perfplast_fenicsx.limit_analysis.conic.principal_cones import PrincipalCones
from perfplast_fenicsx.limit_analysis.velocity.mechanism_rates import MechanismRates
from perfplast_fenicsx.problem.problem import Problem

SUBDIVISIONS = 8
"""Parts of a cell's edge in the composite vertex rule."""


def points_of_cells(problem: Problem) -> Ints:
    """Points of the cells that this rank owns, shape (num_cells, num_points)."""
    topology = problem.tagged_mesh.mesh.topology
    points: Ints = problem.Q.dofmap.list[: topology.index_map(topology.dim).size_local]
    return points


def at_vertices(problem: Problem, values: Floats) -> Floats:
    """Values at vertices of what is linear in each cell and given at the points.

    Args:
        problem: On whose points.
        values: Shape (count, m).

    Returns:
        Shape (num_cells, d + 1, m), for the cells that this rank owns.
    """
    given = values[points_of_cells(problem)]
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
        rates: Linear in each cell.

    Returns:
        Shape (num_cells, d + 1), for the cells that this rank owns.
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
    """Bounds of principal stresses, one a cell, whose points are numbers of these cells.

    Args:
        problem: The bodies.
        rates: On its points.

    Returns:
        The bounds, ``at`` being 0, 1, ...; numbers of the cells, owned by this rank.
    """
    first, given = points_of_cells(problem)[:, 0], rates.principal
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
    """Return the dissipation of cells from above, in the coordinates of their cones.

    Not collective.

    It is ∫ γ(‖dev ε‖ − t·dev ε), or ∫ (γ/α) tr ε where they dilate (:mod:`standard_cones`); where
    principal stresses are bounded see :mod:`principal_cones`. A volume change by rounding that is
    too small for its deviator counts as admissible.

    Args:
        problem: The bodies.
        rates: Linear in each cell.
        subdivisions: Parts of a cell's edge.

    Returns:
        Shape (num_cells,), for the cells that this rank owns.
    """
    points = points_of_cells(problem)
    radii = np.where(np.isfinite(rates.radii), rates.radii, 0.0)
    volumes = rates.weights[points].sum(axis=1)
    scaled = at_vertices(problem, rates.deviator * radii[:, None])
    powers = work_of_cells(volumes, scaled, subdivisions)
    if rates.tilts is not None:
        along = (scaled * at_vertices(problem, rates.tilts)).sum(axis=2)
        powers -= volumes * along.mean(axis=1)
    slopes = rates.slopes[points][:, 0]
    if (dilating := slopes > 0).any():
        growth = at_vertices(problem, rates.trace[:, None])[..., 0]
        growth += missing_growth(problem, rates)
        linear = radii[points][:, 0] * volumes * growth.mean(axis=1)
        powers[dilating] = linear[dilating] / slopes[dilating]
    cones, here = principal_of_cells(problem, rates)
    if cones.count:
        missing = missing_growth(problem, rates)[here].mean(axis=1)
        powers[here] = _of_principal(problem, rates, cones, here, subdivisions)
        powers[here] += volumes[here] * sum(map(np.abs, cones.factors)) * missing
    return powers


def _of_principal(
    problem: Problem, rates: MechanismRates, cones: PrincipalCones, here: Longs, subdivisions: int
) -> Floats:
    """Return the dissipation of cells with cones of principal stresses.

    Args:
        problem: The bodies.
        rates: Linear in each cell.
        cones: Of these cells.
        here: Their numbers.
        subdivisions: Parts of a cell's edge.
    """
    there = at_vertices(problem, np.column_stack([rates.trace, rates.deviator]))[here]
    volumes = rates.weights[points_of_cells(problem)[here]].sum(axis=1)
    of_trace, of_sizes = cones.factors
    found: Floats = of_trace * volumes * there[..., 0].mean(axis=1)
    if of_sizes.any():
        sizes = work_of_cells(
            volumes, there, subdivisions, lambda some: cones.sizes(some[:, 0], some[:, 1:])
        )
        found += of_sizes * sizes
    return found


def work_of_cells(
    volumes: Floats,
    vertex_values: Floats,
    subdivisions: int,
    size: Callable[[Floats], Floats] = lambda values: np.linalg.norm(values, axis=1),
) -> Floats:
    """∫ ‖s‖ of each cell from above, for s linear in it.

    Args:
        volumes: Shape (num_cells,).
        vertex_values: s, shape (num_cells, d + 1, m).
        subdivisions: Parts of a cell's edge.
        size: ‖·‖, a convex function of s, shape (num_cells,) of (num_cells, m).

    Returns:
        Shape (num_cells,).
    """
    points, shares = composite_vertex_rule(vertex_values.shape[1] - 1, subdivisions)
    total: Floats = np.zeros(len(volumes))
    for point, share in zip(points, shares, strict=True):
        total += share * size(np.einsum("v,cvi->ci", point, vertex_values))
    return total * volumes


@lru_cache
def composite_vertex_rule(tdim: int, n: int) -> tuple[Floats, Floats]:
    """Points and shares of the vertex rule on n^tdim equal parts of a simplex.

    The parts are those of Kuhn's division of cubes that lie in the simplex 1 ≥ x₁ ≥ x₂ ≥ ... ≥ 0.

    Returns:
        Barycentric coordinates, shape (num_points, tdim + 1); shares of the volume, which add up
        to 1.
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
    shares = np.bincount(inverse.ravel()) / inverse.size
    ends = np.hstack([np.full((len(grid), 1), n), grid, np.zeros((len(grid), 1), dtype=int)])
    return -np.diff(ends, axis=1) / n, shares
