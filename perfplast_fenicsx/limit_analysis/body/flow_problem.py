"""The problem on whose mesh the mechanism of an upper bound is looked for."""

from dataclasses import dataclass

from perfplast_fenicsx.limit_analysis.discrete.body_cones import body_cones
from perfplast_fenicsx.limit_analysis.facets.ring_flux import by_flux
from perfplast_fenicsx.limit_analysis.facets.vertex_points import with_points_at_vertices
from perfplast_fenicsx.mesh.alfeld_split import AlfeldSplit, alfeld_split
from perfplast_fenicsx.mesh.curved_cells import has_curved_cells
from perfplast_fenicsx.problem.problem import Problem


@dataclass(frozen=True)
class FlowProblem:
    """Where a mechanism is looked for.

    Attributes:
        problem: In space on cells that are split from their centres, around an axis in v = ru
            (:mod:`ring_flux`), and of bodies that dilate with laws at vertices.
        split: How cells are split; None where they are not.
    """

    problem: Problem
    split: AlfeldSplit | None


def flow_problem(problem: Problem) -> FlowProblem:
    """Make it. Collective.

    Args:
        problem: As :func:`limit_bounds.admitted` has it.
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
    """Return how cells are split for strict bounds; None where they are not. Collective."""
    if problem.bodies.gdim == 3 and is_straight(problem):
        return alfeld_split(problem.tagged_mesh)
    return None


def is_straight(problem: Problem) -> bool:
    """Return whether its elements are quadratic on straight cells. Collective."""
    return problem.degree == 2 and not has_curved_cells(problem.tagged_mesh.mesh)
