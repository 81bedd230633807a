"""Compute upper bounds on the dissipation of cells and of slip.

The norm ‖·‖ is convex, so its integral is at most the integral of its linear interpolation on any
subdivision of the cell (the composite vertex rule). The same holds for Σ|ε_i| of the principal
values. A body that dilates dissipates (γ/α) tr ε, which is linear. A linear function that is
nowhere below a varying strength replaces this strength; the product of two linear functions is
integrated exactly.

:func:`dissipation_of_rings` computes upper bounds in axisymmetry, for quadratic v = ru. For the
strain rates ε of u, r²ε is quadratic in the section,

    (r ∂_r v_r − v_r, r ∂_z v_z, v_r, (r ∂_z v_r + r ∂_r v_z − v_z)/√2)   (rr, zz, θθ, √2 rz).

With the Bernstein coefficients q_i of r²ε on a part of a cell, ∫ ‖ε‖ r ≤ Σ ‖q_i‖ ∫ B_i/r, because
‖·‖ is convex and B_i ≥ 0. The function 1/r is convex too and is bounded by the linear interpolation
of its values at the vertices. On a part with an edge on the axis, r²ε is r times a linear function.
On a part with one vertex on the axis, the bound of 1/r is a linear function along the opposite
edge, divided by the relative distance from the vertex. The formulas use only NumPy, except for the
laws of the cells.

:func:`slip_work` computes an upper bound on the dissipation by slip that also holds between nodes.
The jump w of a quadratic velocity has Bernstein coefficients on a facet (:mod:`entering`).
The Bernstein polynomials are not negative and sum to 1. ‖w_t‖ is therefore at most the mean of the
norms of the coefficients, weighted with the polynomials. The integral ∫c‖w_t‖ is at most c times
the area times the unweighted mean of these norms. The jump w lies in the cone w_n ≥ μ‖w_t‖ of
associated Coulomb friction if all its coefficients lie in the cone.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import combinations, permutations, product

from mpi4py import MPI

import numpy as np
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats, Ints, Longs, matrices
from perfplast_fenicsx.compat import interpolation_points
from perfplast_fenicsx.limit_analysis.conic.cone import PointSets
from perfplast_fenicsx.limit_analysis.conic.semidefinite_cones import PrincipalCones
from perfplast_fenicsx.limit_analysis.discrete.body_cones import BodyCones, body_cones
from perfplast_fenicsx.limit_analysis.discrete.point_strains import (
    PointStrains,
    has_coefficients,
    nodes_of_cells,
)
from perfplast_fenicsx.limit_analysis.discrete.strength_fields import profiles_of_cells
from perfplast_fenicsx.limit_analysis.facets.body_interfaces import (
    interfaces_of,
    strength_of,
)
from perfplast_fenicsx.limit_analysis.facets.contact_facets import (
    UNSEEN,
    contact_facets,
    face_jumps,
    flat_faces,
    has_pair,
)
from perfplast_fenicsx.mesh.ring_polynomials import (
    equal_parts,
    of_parts,
    ring_rates,
    weights_of_rates,
)
from perfplast_fenicsx.mesh.straight_geometry import corners, facets_of, gradients, has_curved_cells
from perfplast_fenicsx.problem.problem import Problem


@dataclass(frozen=True, eq=False)
class MechanismRates:
    """Strain rates of a mechanism in the coordinates of the cones, and yield sets at the points.

    Attributes:
        strains: The points, with their volumes and yield sets.
        trace: Traces, shape (count,).
        deviator: Deviator, shape (count, m).
        powers: Strain rates ε for computing power, Mandel vectors
            (:meth:`point_strains.PointStrains.power_rates`), shape (count, m).
        above: Linear functions that are nowhere below the profile, at the vertices of the cells
            that this rank owns, shape (num_cells, d + 1); None if no strength varies or cells are
            curved.
    """

    strains: PointStrains
    trace: Floats
    deviator: Floats
    powers: Floats
    above: Floats | None = None


def mechanism_rates(problem: Problem, mechanism: fem.Function) -> MechanismRates:
    """Return the strain rates of a mechanism, and the yield sets at the points. Collective.

    Args:
        problem: The bodies.
        mechanism: Velocity with updated ghosts.
    """
    at = PointStrains(problem)
    try:
        trace, deviator = at.of_function(mechanism)
        powers = at.power_rates(mechanism)
    finally:
        at.destroy()
    above = None
    if at.profile is not None and not has_curved_cells(problem.tagged_mesh.mesh):
        above = profiles_of_cells(problem, "above")
    return MechanismRates(at, trace, deviator, powers, above)


SUBDIVISIONS = 8
"""Number of parts into which the composite vertex rule divides each edge of a cell."""


def points_of_cells(problem: Problem) -> Ints:
    """Return the points of the cells that this rank owns, shape (num_cells, num_points)."""
    topology = problem.tagged_mesh.mesh.topology
    points: Ints = problem.Q.dofmap.list[: topology.index_map(topology.dim).size_local]
    return points


def at_vertices(problem: Problem, values: Floats) -> Floats:
    """Return the values at vertices of functions that are linear in each cell.

    Args:
        problem: The problem with the points.
        values: Values at the points, shape (count, m).

    Returns:
        Values, shape (num_cells, d + 1, m), for the cells that this rank owns. If the points are
        Bernstein coefficients (:mod:`point_strains`), the result consists of these coefficients,
        shape (num_cells, 6, m).
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
    """Return the amount by which tr ε is too small at the vertices of cells in dilating bodies.

    Not collective.

    Args:
        problem: The bodies.
        rates: Rates that are linear in each cell.

    Returns:
        The difference between α‖dev ε‖ and tr ε where it is positive, for the cells that this rank
        owns, shape (num_cells, d + 1), or at Bernstein coefficients (num_cells, 6).
    """
    slopes = rates.strains.slopes[points_of_cells(problem)][:, :1]
    there = at_vertices(problem, np.column_stack([rates.trace, rates.deviator]))
    needed = slopes * np.linalg.norm(there[..., 1:], axis=2)
    missing: Floats = np.where(slopes > 0, np.maximum(needed - there[..., 0], 0.0), 0.0)
    for one in _sets_of_cells(problem, rates):
        for vertex in range(there.shape[1]):
            rate = one.at_points(there[one.cells, vertex])
            missing[one.cells, vertex] = one.sets.lacking(*rate)
    return missing


@dataclass(frozen=True, eq=False)
class _SetsOfCells:
    """Yield sets of ``rates.strains.sets``, one for each cell, at the cell's first point.

    Attributes:
        sets: The sets, in the order of the cells, without the strength profile.
        cells: Numbers of the cells, shape (num,).
        count: Number of points.
    """

    sets: PointSets
    cells: Longs
    count: int

    def at_points(self, rates: Floats) -> tuple[Floats, Floats]:
        """Return trace and deviator at all points from rates of cells; zero except first points."""
        found: Floats = np.zeros((self.count, rates.shape[1]))
        found[self.sets.at] = rates
        return found[:, 0], found[:, 1:]


def _sets_of_cells(problem: Problem, rates: MechanismRates) -> Iterator[_SetsOfCells]:
    """Yield each item of ``rates.strains.sets`` for the cells that this rank owns."""
    of_points = np.full(rates.strains.count, -1)
    first = points_of_cells(problem)[:, 0]
    of_points[first] = np.arange(len(first))
    for sets in rates.strains.sets:
        if isinstance(sets, PrincipalCones) and rates.strains.profile is not None:
            sets = sets.scaled(1 / rates.strains.profile)
        chosen = np.flatnonzero(of_points[sets.at] >= 0)
        yield _SetsOfCells(sets.those(chosen), of_points[sets.at[chosen]], rates.strains.count)


def dissipation_of_cells(
    problem: Problem, rates: MechanismRates, subdivisions: int = SUBDIVISIONS
) -> Floats:
    """Return upper bounds on the dissipation of cells, from strain rates in the cones' coordinates.

    Not collective. The dissipation is ∫ γ(‖dev ε‖ − t·dev ε), or ∫ (γ/α) tr ε in dilating bodies
    (:mod:`standard_cones`). For sets of principal stresses, see :mod:`semidefinite_cones`. A strain
    rate whose volume change is too small for its deviator only because of rounding counts as
    admissible.

    Args:
        problem: The bodies.
        rates: Rates that are linear in each cell.
        subdivisions: Parts of a cell's edge.

    Returns:
        Shape (num_cells,), for the cells that this rank owns.
    """
    points = points_of_cells(problem)
    radii = np.where(np.isfinite(rates.strains.radii), rates.strains.radii, 0.0)
    if rates.strains.profile is not None:
        radii = radii / rates.strains.profile
    volumes = rates.strains.weights[points].sum(axis=1)
    scaled = at_vertices(problem, rates.deviator * radii[:, None])
    powers = work_of_cells(volumes, scaled, subdivisions, rates.above)
    if rates.strains.tilts is not None:
        along = (scaled * at_vertices(problem, rates.strains.tilts)).sum(axis=2)
        powers -= volumes * mean_of(along, rates.above)
    slopes = rates.strains.slopes[points][:, 0]
    if (dilating := slopes > 0).any():
        growth = at_vertices(problem, rates.trace[:, None])[..., 0]
        growth += missing_growth(problem, rates)
        linear = radii[points][:, 0] * volumes * mean_of(growth, rates.above)
        powers[dilating] = linear[dilating] / slopes[dilating]
    for one in _sets_of_cells(problem, rates):
        powers[one.cells] = _of_sets(problem, rates, one, subdivisions)
    return powers


def _of_sets(
    problem: Problem, rates: MechanismRates, one: _SetsOfCells, subdivisions: int
) -> Floats:
    """Return upper bounds on the dissipation of the cells with the yield sets ``one``."""
    there = at_vertices(problem, np.column_stack([rates.trace, rates.deviator]))[one.cells]
    volumes = rates.strains.weights[points_of_cells(problem)[one.cells]].sum(axis=1)
    above = None if rates.above is None else rates.above[one.cells]

    def work(size: Callable[[Floats, Floats], Floats]) -> Floats:
        return work_of_cells(
            volumes, there, subdivisions, above, lambda rate: size(*one.at_points(rate))
        )

    if not isinstance(one.sets, PrincipalCones):
        return work(one.sets.powers)
    of_trace, of_sizes = one.sets.factors
    missing = mean_of(missing_growth(problem, rates)[one.cells], above)
    powers = of_trace * mean_of(there[..., 0], above) + (abs(of_trace) + abs(of_sizes)) * missing
    return volumes * powers + (of_sizes * work(one.sets.sizes) if of_sizes.any() else 0.0)


def mean_of(values: Floats, factors: Floats | None) -> Floats:
    """Return the means of linear functions, or of their products with linear functions, by cell.

    Args:
        values: Values at the vertices, shape (num_cells, d + 1, ...).
        factors: Values of the factors at the vertices, of the same shape; None without factors.
    """
    if factors is None:
        return np.asarray(values.mean(axis=1))
    n = values.shape[1]
    sums = (values * factors).sum(axis=1) + values.sum(axis=1) * factors.sum(axis=1)
    return np.asarray(sums / (n * (n + 1)))


def work_of_cells(
    volumes: Floats,
    vertex_values: Floats,
    subdivisions: int,
    profile: Floats | None = None,
    size: Callable[[Floats], Floats] = lambda values: np.linalg.norm(values, axis=1),
) -> Floats:
    """Return an upper bound on ∫ f‖s‖ over each cell, for s and f that are linear in the cell.

    Args:
        volumes: Volumes of the cells, shape (num_cells,).
        vertex_values: Values s at the vertices, shape (num_cells, d + 1, m).
        subdivisions: Parts of a cell's edge.
        profile: Factor f ≥ 0 at the vertices, shape (num_cells, d + 1); None for 1.
        size: Norm ‖·‖, or another convex function; it maps values s of shape (num_cells, m) to
            shape (num_cells,).

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
    """Return the points and shares of the vertex rule on n^tdim equal parts of a simplex.

    The parts are the simplices of Kuhn's division of cubes that lie within 1 ≥ x₁ ≥ x₂ ≥ ... ≥ 0.

    Returns:
        Barycentric coordinates, shape (num_points, tdim + 1), and shares of the volume, of the same
        shape. A share is the integral of a point's hat function times a barycentric coordinate,
        divided by the volume. The shares sum to 1.
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
    # the integral of λ_k λ_l over a part is (1 + δ_kl)/((d + 1)(d + 2)) times its volume
    of_parts = points[parts]
    moments = of_parts + of_parts.sum(axis=1, keepdims=True)
    shares = np.zeros_like(points)
    np.add.at(shares, parts, moments / ((tdim + 1) * (tdim + 2) * len(parts)))
    return points, shares


def dissipation_of_rings(problem: Problem, velocity: fem.Function, subdivisions: int) -> Floats:
    """Return upper bounds on the dissipation of axisymmetric cells. Not collective.

    Args:
        problem: Problem with v = ru as the unknown (:mod:`ring_flux`).
        velocity: Velocity v with updated ghosts.
        subdivisions: Parts of a cell's edge.

    Returns:
        Shape (num_cells,), for the cells that this rank owns.
    """
    vertices, points = corners(problem.tagged_mesh.mesh)
    x, (nodes, _) = points[vertices], nodes_of_cells(problem, len(vertices))
    rates = ring_rates(x, velocity.x.array.reshape(-1, 2)[nodes])
    _, areas = gradients(x)
    cones = body_cones(problem)
    total: Floats = np.zeros(len(x))
    parts = equal_parts(subdivisions)
    for part in parts:
        q = of_parts(rates, np.broadcast_to(part, (len(x), 3, 3)))
        weights = weights_of_rates(x[..., 0] @ part.T, areas / len(parts))
        total += np.einsum("ci,ci->c", weights, _powers(cones, q))
    return 2 * math.pi * total


def _powers(cones: BodyCones, rates: Floats) -> Floats:
    """Return the dissipation of strain rates per volume, shape (num_cells, 6).

    The dissipation is a convex function of the strain rate. If a dilation is too small for its
    deviator because of rounding, the function uses the least admissible dilation.
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


UNKNOWN = "the slip of nodes that supports hold along their normal is unknown"

CLOSED = "between nodes, surfaces with Coulomb's friction separate too little for their slip"


@dataclass(frozen=True)
class SlipWork:
    """The dissipation by slip, and related sums over the same surfaces.

    Attributes:
        power: Upper bound on ∫c‖w_t‖, summed over all ranks.
        squares: Sum of ∫(‖w_t‖/h)² over layers whose thickness is the size h of the facet. This sum
            corresponds to ∫‖ε(v)‖² in cells.
        why_not: Reasons why the dissipation may be larger, or why the slip is inadmissible, as
            clauses.
        shares: For each owned cell, the contribution of slip at its facets to the gap between a
            velocity and a stress, shape (num_cells,). The contribution is ∫c‖w_t‖ − r·w; each side
            has half of it. It is 0 without a stress.
    """

    power: float
    squares: float
    why_not: tuple[str, ...]
    shares: Floats = field(repr=False)


def slip_work(problem: Problem, velocity: fem.Function, stress: Floats | None = None) -> SlipWork:
    """Return the dissipation by slip of a velocity; zero on curved surfaces. Collective.

    Args:
        problem: The bodies and their contact, on straight cells.
        velocity: Velocity with updated ghosts.
        stress: Mandel vectors at the vertices of the owned cells, shape (num_cells, d + 1, m); None
            if the shares of cells in the gap are not needed.
    """
    topology = problem.tagged_mesh.mesh.topology
    shares = np.zeros(topology.index_map(topology.dim).size_local)
    strengths = [strength_of(source) for source in problem.constraints.sources]
    flat = flat_faces(problem) is not None
    if not flat or not any(it.adhesion or it.friction for it in strengths):
        return SlipWork(0.0, 0.0, (), shares)
    comm = problem.comm
    facets = contact_facets(problem)
    nodes, gdim = facets.nodes, facets.normals.shape[1]
    constraints = problem.constraints
    moves = ~has_pair(problem) & ~problem.fixed.all(axis=1)
    rubbing = (it for it in interfaces_of(problem) if it.strength.adhesion or it.strength.friction)
    tags = problem.tagged_mesh.tags_of({name for it in rubbing for name in it.surfaces})
    unknown = bool(moves[nodes[np.isin(facets.tags, tags)]].any())
    sums, lacking = np.zeros(2), 0.0
    for face in face_jumps(problem, velocity):
        strength = strengths[face.source]
        if not (strength.adhesion or strength.friction):
            continue
        unknown |= bool(face.moves[nodes[face.here]].any())
        sides = 2 if constraints.sources[face.source].inner else 1
        mine = facets.areas > 0
        owned, sizes = np.flatnonzero(face.here & mine), face.across[mine[face.here]]
        area, at = facets.areas[owned] / sides, nodes[owned]
        lost = strength.adhesion * area * sizes.mean(axis=1)
        layers = area * facets.areas[owned] ** (-1 / (gdim - 1))
        sums += lost.sum(), layers @ (sizes**2).mean(axis=1)
        if stress is not None:
            cells, out = facets.cells[owned], facets.normals[owned]
            around = facets_of(gdim)[facets.sides[owned]]
            tractions = (
                matrices(stress[cells[:, None], around])[..., :gdim, :gdim] @ out[:, None, :, None]
            )
            towards = np.sign(out @ face.normal)
            mean = _means(at.shape[1], gdim)
            means = np.einsum("fai,an,fni->f", tractions[..., 0], mean, face.w[at])
            np.add.at(shares, cells, lost + towards * area * means)
        if strength.friction:
            lacking = max(lacking, face.entered(strength.friction))
    why = {
        UNKNOWN: comm.allreduce(unknown, MPI.LOR),
        CLOSED: comm.allreduce(lacking, MPI.MAX) > UNSEEN,
    }
    found = tuple(words for words, is_so in why.items() if is_so)
    power, squares = comm.allreduce(sums)
    return SlipWork(float(power), float(squares), found, shares)


def _means(num_nodes: int, gdim: int) -> Floats:
    """Return the mean over a facet of each barycentric coordinate times each Bernstein polynomial.

    Args:
        num_nodes: Number of nodes of a facet, which is also the number of polynomials: one for each
            vertex, and one for each pair of vertices in quadratic elements.
        gdim: Number of vertices of the facet.

    Returns:
        Shape (gdim, num_nodes).
    """
    same = np.eye(gdim)
    if num_nodes == gdim:
        return (1 + same) / (gdim * (gdim + 1))
    edges = np.array([*combinations(range(gdim), 2)])
    parts = np.hstack([1 + 2 * same, 1 + same[:, edges].sum(axis=2)])
    return 2 * parts / (gdim * (gdim + 1) * (gdim + 2))
