"""Compute the share of each cell in the gap between lower and upper bound, for refinement.

For an admissible mechanism with L(v) = 1 and a stress in equilibrium with λ⁻,

    λ⁺ − λ⁻ = Σ_T η_T + W,   η_T = ∫_T D(ε(v)) − σ:ε(v) ≥ 0,

where D is the dissipation, γ‖dev ε‖ or, in dilating bodies, (γ/α) tr ε. W ≥ 0 is the work of
contact pressures on gaps that open. On surfaces with friction, the dissipation less the work of
their tractions is divided between the cells of both sides (:mod:`slip_work`).
"""

import numpy as np
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.compat import interpolation_points
from perfplast_fenicsx.limit_analysis.discrete.ring_strains import has_coefficients
from perfplast_fenicsx.limit_analysis.velocity.cell_dissipation import (
    SUBDIVISIONS,
    at_vertices,
    dissipation_of_cells,
    points_of_cells,
)
from perfplast_fenicsx.limit_analysis.velocity.mechanism_rates import (
    MechanismRates,
    mechanism_rates,
)
from perfplast_fenicsx.limit_analysis.velocity.ring_dissipation import dissipation_of_rings
from perfplast_fenicsx.limit_analysis.velocity.slip_work import slip_work
from perfplast_fenicsx.mesh.ring_polynomials import coefficients_of_radius, polynomials
from perfplast_fenicsx.mesh.straight_geometry import corners, gradients
from perfplast_fenicsx.problem.problem import Problem


def gap_shares(
    problem: Problem,
    mechanism: fem.Function,
    stress: Floats,
    rates: MechanismRates | None = None,
) -> Floats:
    """Return upper bounds of the shares η_T of the cells that this rank owns. Collective.

    Args:
        problem: The bodies and their loads, on straight cells.
        mechanism: Admissible mechanism with L(v) = 1 and updated ghosts.
        stress: Mandel vectors at the vertices of these cells, linear between them, shape
            (num_cells, d + 1, 4 or 6); in axisymmetry coefficients of rσ (:mod:`stress_cells`),
            shape (num_cells, 6, 4).
        rates: Rates of the mechanism; evaluated by default.

    Returns:
        Shape (num_cells,).
    """
    if rates is None:
        rates = mechanism_rates(problem, mechanism)
    if problem.tagged_mesh.axisymmetric:
        return _of_rings(problem, rates, mechanism, stress)
    most = dissipation_of_cells(problem, rates)
    there = at_vertices(problem, rates.powers)
    volumes = rates.weights[points_of_cells(problem)].sum(axis=1)
    count = there.shape[1]
    sums = np.einsum("ci,ci->c", stress.sum(axis=1), there.sum(axis=1))
    power = volumes * (np.einsum("cvi,cvi->c", stress, there) + sums) / (count * (count + 1))
    shares: Floats = most - power
    shares += slip_work(problem, mechanism, stress).shares
    return shares


def _of_rings(
    problem: Problem, rates: MechanismRates, mechanism: fem.Function, stress: Floats
) -> Floats:
    """Return the shares in axisymmetry, with the work of the stress by a quadrature rule."""
    points = points_of_cells(problem)
    vertices, places = corners(problem.tagged_mesh.mesh)
    x = places[vertices]
    if has_coefficients(problem):
        shares = np.full((3, 3), 1 / 6) + np.eye(3) / 2
        rho = coefficients_of_radius(x)[..., None]
        powers = np.einsum("pi,cim->cpm", polynomials(shares), rho * rates.powers[points])
        powers /= (x[..., 0] @ shares.T)[..., None]
        _, areas = gradients(x)
        weights = np.repeat(2 * np.pi / 3 * areas[:, None], 3, axis=1)
    else:
        at = interpolation_points(problem.S.element)
        shares = np.hstack([1 - at.sum(axis=1, keepdims=True), at])
        powers, weights = rates.powers[points], rates.weights[points]
    radii = x[..., 0] @ shares.T
    work = np.einsum("pi,cim,cpm->cp", polynomials(shares), stress, powers) / radii
    power = np.einsum("cp,cp->c", weights, work)
    return np.asarray(dissipation_of_rings(problem, mechanism, SUBDIVISIONS) - power)
