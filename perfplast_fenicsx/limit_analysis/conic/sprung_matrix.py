"""A stiffness with springs at the jumps of contact, and its factors."""

from collections.abc import Mapping

from petsc4py import PETSc

from perfplast_fenicsx.arrays import Floats, Ints
from perfplast_fenicsx.limit_analysis.conic.discretisation import SingularStiffness
from perfplast_fenicsx.profiling import phase
from perfplast_fenicsx.solvers.linear.failed_factors import forget_factors
from perfplast_fenicsx.solvers.linear.mumps_memory import check_memory
from perfplast_fenicsx.solvers.linear.petsc_options import LIMIT, own_prefix
from perfplast_fenicsx.solvers.linear.supernodal import SupernodalFactors


class SprungMatrix:
    """The common part of both kinds of :class:`discretisation.Stiffness`, for an assembled matrix.

    Attributes:
        factorisations: So far.
        solves: Systems solved so far.
    """

    def __init__(
        self, comm: PETSc.Comm, matrix: PETSc.Mat, jumps: Ints, options: Mapping[str, object]
    ) -> None:
        """Take a matrix over that is still to be assembled. Collective.

        Args:
            comm: The ranks.
            matrix: Assembled again by the owner of this.
            jumps: Owned unknowns that are jumps.
            options: PETSc's, of the factorisation.
        """
        self._matrix, self._jumps = matrix, jumps
        self.factorisations = self.solves = 0
        self._ksp = PETSc.KSP().create(comm)
        self._ksp.setOptionsPrefix(own_prefix(self, LIMIT, options))
        self._ksp.setFromOptions()
        self._supernodal, self._checked = SupernodalFactors(), False
        self._used = self._ksp

    def destroy(self) -> None:
        """Give PETSc's memory back. Collective."""
        for thing in (self._supernodal, self._ksp, self._matrix):
            thing.destroy()

    @property
    def uses(self) -> str:
        """PETSc's name of what has made the last factors."""
        return str(self._used.getPC().getFactorSolverType())

    def jump_diagonal(self) -> Floats:
        """Diagonal entries of the jumps of this rank's pairs. Collective."""
        diagonal = self._matrix.getDiagonal()
        values: Floats = diagonal.array_r[self._jumps].copy()
        diagonal.destroy()
        return values

    def add_at_jumps(self, springs: Floats) -> None:
        """Add c to the diagonal, shape (num_pairs,) on each rank. Collective."""
        diagonal = self._matrix.getDiagonal()
        diagonal.array[self._jumps] += springs
        self._matrix.setDiagonal(diagonal)
        diagonal.destroy()

    def check_once(self) -> None:
        """Refuse the matrix if its factors do not fit into memory, once. Collective.

        Raises:
            TooLarge: With what is needed and what there is.
        """
        if not self._checked:
            self._ksp.setOperators(self._matrix)
            self._checked, analysis = True, check_memory(self._ksp)
            self._supernodal.take_over(self._ksp, analysis, LIMIT)

    @phase("linear set-up")
    def factorise(self) -> None:
        """Factorise the matrix as it is. Collective.

        Raises:
            SingularStiffness: If that fails.
            InputError: If it takes more memory than there is, before the first one.
        """
        self.check_once()
        self.factorisations += 1
        self._used = self._supernodal.factorise(self._matrix) or self._ksp
        if self._used is not self._ksp:
            return
        self._ksp.setOperators(self._matrix)
        self._ksp.setUp()
        if self._ksp.getPC().getFailedReason():
            forget_factors(self._ksp)
            raise SingularStiffness("the stiffness could not be factorised")

    @phase("linear solve")
    def solve(self, b: PETSc.Vec, x: PETSc.Vec) -> None:
        """Solve K x = b with the last factors. Collective."""
        self._used.solve(b, x)
        self.solves += 1
