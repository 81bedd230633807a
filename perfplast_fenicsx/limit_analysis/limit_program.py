"""The limit load of a discrete problem; velocities are displacements in the contact basis."""

from perfplast_fenicsx.limit_analysis.conic_program import ConicProgram
from perfplast_fenicsx.limit_analysis.conic_stiffness import ConicStiffness
from perfplast_fenicsx.limit_analysis.discretisation import Discretisation, Stiffness, Strains
from perfplast_fenicsx.limit_analysis.friction_points import FrictionStiffness, FrictionStrains
from perfplast_fenicsx.limit_analysis.point_strains import PointStrains
from perfplast_fenicsx.problem.problem import Problem


def limit_program(problem: Problem) -> ConicProgram:
    """Compile the forms. Collective."""
    points, bodies = PointStrains(problem), ConicStiffness(problem)
    strains: Strains = points
    stiffness: Stiffness = bodies
    if problem.friction.count:
        strains = both = FrictionStrains(points, problem.friction)
        stiffness = FrictionStiffness(bodies, both, points.count)
    load = problem.create_vector()
    problem.basis.T.multTranspose(problem.loads.live, load)
    jumps = problem.basis.index
    return ConicProgram(Discretisation(problem.comm, strains, stiffness, load, jumps))
