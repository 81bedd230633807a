"""Evaluate the strain rates of a mechanism at the points, once for all uses."""

from dataclasses import dataclass

from dolfinx import fem

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.conic.semidefinite_cones import PrincipalCones, principal_of
from perfplast_fenicsx.limit_analysis.discrete.point_strains import PointStrains
from perfplast_fenicsx.limit_analysis.discrete.strength_fields import profiles_of_cells
from perfplast_fenicsx.mesh.straight_geometry import has_curved_cells
from perfplast_fenicsx.problem.problem import Problem


@dataclass(frozen=True, eq=False)
class MechanismRates:
    """Rates in the coordinates of the points' cones, with the bounds of stresses there.

    Attributes:
        trace: Trace, shape (count,).
        deviator: Deviator, shape (count, m).
        powers: Rates ε that do the work of stresses, Mandel vectors
            (:meth:`point_strains.PointStrains.power_rates`), shape (count, m).
        count: Number of points of this rank.
        gdim: As in :class:`discretisation.Strains`, as are the next four.
        weights: Volume of a point, shape (count,).
        radii: Yield radius γ, shape (count,).
        slopes: Slope α, shape (count,).
        tilts: Tilt t, shape (count, m); None where all are zero.
        principal: Bounds of principal stresses at their points.
        profile: Factor of γ, and of bounds of principal stresses, by which strengths vary in space,
            shape (count,); None if no strength varies.
        above: Linear functions that are nowhere below the profile, at the vertices of the cells
            that this rank owns, shape (num_cells, d + 1); None if no strength varies or cells are
            curved.
    """

    trace: Floats
    deviator: Floats
    powers: Floats
    count: int
    gdim: int
    weights: Floats
    radii: Floats
    slopes: Floats
    tilts: Floats | None
    principal: PrincipalCones
    profile: Floats | None = None
    above: Floats | None = None


def mechanism_rates(problem: Problem, mechanism: fem.Function) -> MechanismRates:
    """Return the rates of a mechanism. Collective.

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
    bounded = at.weights, at.radii, at.slopes, at.tilts, principal_of(at.sets), at.profile, above
    return MechanismRates(trace, deviator, powers, at.count, at.gdim, *bounded)
