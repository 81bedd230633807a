"""Pose the limit load of a discrete problem, with displacements in the contact basis."""

from perfplast_fenicsx.limit_analysis.conic.conic_program import ConicProgram
from perfplast_fenicsx.limit_analysis.conic.discretisation import Discretisation, Stiffness, Strains
from perfplast_fenicsx.limit_analysis.discrete.conic_stiffness import ConicStiffness
from perfplast_fenicsx.limit_analysis.discrete.friction_points import (
    FrictionStiffness,
    FrictionStrains,
    SlipPlaces,
)
from perfplast_fenicsx.limit_analysis.discrete.point_strains import PointStrains
from perfplast_fenicsx.limit_analysis.statements.question import Question
from perfplast_fenicsx.problem.problem import Problem


def limit_program(problem: Problem, question: Question, reserve: float) -> ConicProgram:
    """Return the program of a problem's limit load. Collective."""
    points = PointStrains(problem)
    bodies = ConicStiffness(problem, points)
    strains: Strains = points
    stiffness: Stiffness = bodies
    if problem.friction.count:
        strains = both = FrictionStrains(points, SlipPlaces.of(problem.friction))
        stiffness = FrictionStiffness(bodies, both, points.count)
    live, dead = problem.create_vector(), problem.create_vector()
    problem.basis.T.multTranspose(problem.loads.live, live)
    problem.basis.T.multTranspose(problem.loads.dead, dead)
    loads = question.loads(live, dead)
    return ConicProgram(
        Discretisation(problem.comm, strains, stiffness, *loads, jumps=problem.basis.index),
        reserve,
    )
