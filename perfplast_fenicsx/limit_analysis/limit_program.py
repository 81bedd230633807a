"""The limit load of a discrete problem; velocities are displacements in the contact basis."""

from perfplast_fenicsx.limit_analysis.conic_program import ConicProgram, Discretisation
from perfplast_fenicsx.limit_analysis.conic_stiffness import ConicStiffness
from perfplast_fenicsx.limit_analysis.point_strains import PointStrains
from perfplast_fenicsx.problem.problem import Problem


def limit_program(problem: Problem) -> ConicProgram:
    """Compile the forms. Collective."""
    strains, stiffness = PointStrains(problem), ConicStiffness(problem)
    load = problem.create_vector()
    problem.basis.T.multTranspose(problem.loads.live, load)
    jumps = problem.basis.index
    return ConicProgram(Discretisation(problem.comm, strains, stiffness, load, jumps))
