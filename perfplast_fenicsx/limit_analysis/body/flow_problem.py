"""Create the problem on whose mesh the mechanism of an upper bound is sought."""

from dataclasses import dataclass

from perfplast_fenicsx.limit_analysis.discrete.body_cones import body_cones
from perfplast_fenicsx.limit_analysis.facets.ring_flux import by_flux
from perfplast_fenicsx.limit_analysis.facets.vertex_points import with_points_at_vertices
from perfplast_fenicsx.mesh.alfeld_split import AlfeldSplit, alfeld_split
from perfplast_fenicsx.mesh.straight_geometry import has_curved_cells
from perfplast_fenicsx.problem.problem import Problem


@dataclass(frozen=True)
class FlowProblem:
    """The problem in which a mechanism is sought.

    Attributes:
        problem: The problem: in space on cells split from their centres, in axisymmetry in v = ru
            (:mod:`ring_flux`), and for dilating bodies with laws at vertices.
        split: How cells are split; None without a split.
    """

    problem: Problem
    split: AlfeldSplit | None


def flow_problem(problem: Problem) -> FlowProblem:
    """Return the flow problem of a problem. Collective.

    Args:
        problem: See :func:`limit_bounds.admitted`.
    """
    straight, split = is_straight(problem), split_of(problem)
    if split is not None:
        problem = problem.on(split)
    if problem.tagged_mesh.axisymmetric and straight:
        problem = by_flux(problem)
    if straight and body_cones(problem).dilates:
        problem = with_points_at_vertices(problem)
    return FlowProblem(problem, split)


def split_of(problem: Problem) -> AlfeldSplit | None:
    """Return how cells are split for strict bounds; None if they are not. Collective."""
    if problem.bodies.gdim == 3 and is_straight(problem):
        return alfeld_split(problem.tagged_mesh)
    return None


def is_straight(problem: Problem) -> bool:
    """Return whether the elements are quadratic on straight cells. Collective."""
    return problem.degree == 2 and not has_curved_cells(problem.tagged_mesh.mesh)
