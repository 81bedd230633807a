"""Factorise the stiffness in the contact basis, with moduli given at each point."""

from perfplast_fenicsx.arrays import Floats, Ints
from perfplast_fenicsx.limit_analysis.conic.cone import Moduli
from perfplast_fenicsx.limit_analysis.conic.discretisation import NONE, SprungMatrix
from perfplast_fenicsx.limit_analysis.discrete.body_stiffness import BodyStiffness
from perfplast_fenicsx.limit_analysis.discrete.point_strains import PointStrains
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.profiling import phase
from perfplast_fenicsx.solvers.linear.contact_operator import ContactOperator
from perfplast_fenicsx.solvers.linear.factorisation import DIRECT


class ConicStiffness(SprungMatrix):
    """K of displacements in the contact basis; see :class:`discretisation.Stiffness`."""

    def __init__(self, problem: Problem, points: PointStrains) -> None:
        """Compute the pattern. Collective.

        Args:
            problem: The problem of the displacements.
            points: Strains at its points.
        """
        self._problem = problem
        self._bodies = BodyStiffness(problem, points)
        self._operator = ContactOperator(problem, self._bodies.matrix)
        super().__init__(problem.comm, self._operator.matrix, problem.basis.index, DIRECT)

    def destroy(self) -> None:
        """Free PETSc's memory. Collective."""
        super().destroy()
        self._bodies.destroy()

    @phase("assembly")
    def assemble(self, moduli: Moduli, held: Ints = NONE) -> None:
        """Assemble K with moduli at the points of this rank. Collective.

        Args:
            moduli: Moduli at the points.
            held: Local (owned) unknowns that stay zero.
        """
        self._bodies.assemble(moduli)
        self._problem.free.hold(self._bodies.matrix)
        self._operator.hold(held)

    def add_springs(self, springs: tuple[Ints, Floats]) -> None:
        """Add springs to K at a few unknowns, from the next assembly on.

        Args:
            springs: See :meth:`ContactOperator.add_springs`.
        """
        self._operator.add_springs(springs)
