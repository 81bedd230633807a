"""What each cell has of the gap between a lower and an upper bound: where to refine.

With a mechanism of L(v) = 1 that keeps the volume, and a stress in equilibrium with λ⁻,

    λ⁺ − λ⁻ = Σ_T η_T + W,   η_T = ∫_T γ‖ε(v)‖ − σ:ε(v) ≥ 0,

where W ≥ 0 is the work of contact pressures on gaps that open.
"""

import numpy as np
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.point_strains import PointStrains
from perfplast_fenicsx.limit_analysis.strict_work import (
    SUBDIVISIONS,
    at_vertices,
    points_of_cells,
    work_of_cells,
)
from perfplast_fenicsx.problem.problem import Problem


def gap_shares(problem: Problem, mechanism: fem.Function, stress: Floats) -> Floats:
    """Shares η_T of the cells that this rank owns, from above. Collective.

    Args:
        problem: The bodies and their loads, on straight cells.
        mechanism: Admissible, with L(v) = 1, its ghosts up to date.
        stress: Mandel vectors at the vertices of these cells, linear between them, shape
            (num_cells, d + 1, 4 or 6).

    Returns:
        Shape (num_cells,).
    """
    strains = PointStrains(problem)
    try:
        _, deviator = strains.of_function(mechanism)
        rates = at_vertices(problem, deviator)
        radii = np.where(np.isfinite(strains.radii), strains.radii, 0.0)
        scaled = at_vertices(problem, deviator * radii[:, None])
        volumes = strains.weights[points_of_cells(problem)].sum(axis=1)
    finally:
        strains.destroy()
    most = work_of_cells(volumes, scaled, SUBDIVISIONS)
    count = rates.shape[1]
    sums = np.einsum("ci,ci->c", stress.sum(axis=1), rates.sum(axis=1))
    power = volumes * (np.einsum("cvi,cvi->c", stress, rates) + sums) / (count * (count + 1))
    shares: Floats = most - power
    return shares
