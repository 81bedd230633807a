"""Define problems and linear systems for several tests in this folder."""

from mpi4py import MPI
from petsc4py import PETSc

from perfplast_fenicsx import BodyForce, Contact, Problem, Support, Traction, punch, two_blocks
from perfplast_fenicsx.contact.declared.obstacles import Plane
from perfplast_fenicsx.problem.fields.quadrature_fields import QuadratureFields
from perfplast_fenicsx.problem.fields.stiffness import Stiffness
from perfplast_fenicsx.solvers.linear.contact_operator import ContactOperator
from tests.models import STEEL


def corner_problem() -> Problem:
    """Return a punch on a block in a corner of two rigid planes; edge nodes have two normals."""
    return Problem(
        punch(MPI.COMM_WORLD, 4),
        {"base": STEEL, "punch": STEEL},
        [Support("y0", "y")],
        [Traction("top", (-0.2, 0.0, -1.0)), BodyForce("base", (-0.1, 0.0, 0.0))],
        [Contact("punch_bottom", "base_top", 0.0)],
        [
            Plane("x0", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0)),
            Plane("bottom", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
        ],
    )


def quadratic_problem() -> Problem:
    return Problem(
        two_blocks(MPI.COMM_WORLD, 2),
        {"lower": STEEL, "upper": STEEL},
        [Support("left")],
        [Traction("top", (0.0, 0.0, -1.0))],
        [Contact("upper_bottom", "lower_top", 0.0)],
        degree=2,
    )


def elastic_operator(problem: Problem) -> ContactOperator:
    """Return the operator of the unloaded, elastic bodies."""
    fields = QuadratureFields(problem)
    fields.update()
    return ContactOperator(problem, Stiffness(fields).assemble(1.0))


def loads(problem: Problem) -> PETSc.Vec:
    """Return loads in the jump basis, with the jumps held."""
    b = problem.create_vector()
    problem.basis.T.multTranspose(problem.loads.live, b)
    b.array[problem.basis.index] = 0
    return b
