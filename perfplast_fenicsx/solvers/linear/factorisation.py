"""Solve systems by a factorisation: MUMPS Cholesky, unless the user selects another one.

If only a few held unknowns change, the change of the matrix has low rank, and CG with the old
factors takes a few iterations.
"""

from collections.abc import Mapping

from mpi4py import MPI
from petsc4py import PETSc

from perfplast_fenicsx.arrays import Ints
from perfplast_fenicsx.profiling import phase
from perfplast_fenicsx.solvers.linear.contact_operator import ContactOperator
from perfplast_fenicsx.solvers.linear.failed_factors import forget_factors
from perfplast_fenicsx.solvers.linear.mumps_memory import (
    ENTRIES,
    OPERATIONS,
    Price,
    entries_of,
    price,
)
from perfplast_fenicsx.solvers.linear.outcome import Outcome, run
from perfplast_fenicsx.solvers.linear.petsc_options import LINEAR, own_prefix, solver_name

DIRECT = {
    "ksp_type": "preonly",
    "pc_type": "cholesky",
    "pc_factor_mat_solver_type": "mumps",
    "mat_mumps_icntl_14": 100,  # additional working space (%), which parallel pivoting may need
}


USELESS = 0.1
"""A solution with a larger relative residual is not accepted."""


class Factorisation:
    """A factorisation of the operator with its held unknowns.

    Attributes:
        name: Name of the solver in messages.
    """

    def __init__(
        self, comm: MPI.Intracomm, preset: Mapping[str, object] = DIRECT, heed: bool = True
    ) -> None:
        """Create the solver. Collective.

        Args:
            comm: The ranks.
            preset: Default options.
            heed: Whether the user's options apply.
        """
        self._ksp = PETSc.KSP().create(comm)
        self._ksp.setOptionsPrefix(own_prefix(self, LINEAR, preset, heed))
        self._ksp.setFromOptions()
        self.name = solver_name(self._ksp.getType(), self._ksp.getPC().getType())
        self._matrix: PETSc.Mat | None = None
        self._cg = PETSc.KSP().create(comm)
        # Options for solves with the factors of another matrix.
        kept = {"ksp_type": "cg", "ksp_norm_type": "unpreconditioned"}
        self._cg.setOptionsPrefix(own_prefix(self, LINEAR, kept, heed=False))
        self._cg.setFromOptions()
        self._cg.setPC(self._ksp.getPC())
        self._kept = self._failed = False

    @property
    def worth(self) -> int:
        """Return the number of iterations with old factors that cost as much as new ones, or 0."""
        pc = self._ksp.getPC()
        if pc.getFactorSolverType() != "mumps":
            return 0
        factors = pc.getFactorMatrix()
        entries = entries_of(factors, ENTRIES)
        # Time of CG per entry of the factors, in operations of a factorisation, which works in
        # cache.
        balance = 40.0
        iterations = int(factors.getMumpsRinfog(OPERATIONS) / (balance * max(entries, 1)))
        # Factorisations that cost less than this number of iterations are always repeated.
        least_worth = 5
        return iterations if iterations >= least_worth else 0

    def price(self) -> Price:
        """Return the cost of a factorisation, without a set-up. Collective."""
        assert self._matrix is not None
        return price(self._ksp, self._matrix)

    def prepare(self, operator: ContactOperator) -> bool:
        """Do nothing and return True: this method suits any operator."""
        return True

    @phase("linear set-up")
    def set_matrix(self, operator: ContactOperator, held: Ints) -> None:
        """Take the matrix of an operator in which ``held`` is eliminated. Collective."""
        self._matrix = operator.matrix
        self._ksp.setOperators(self._matrix)
        self._cg.setOperators(self._matrix)

    def renew(self, flow: PETSc.Vec | None) -> None:
        """Factorise at the next solve."""
        if self._failed:
            forget_factors(self._ksp)
            self._failed = False
        self._ksp.getPC().setReusePreconditioner(False)
        self._kept = False

    def keep(self) -> None:
        """Solve by CG with the present factors, as long as this costs less than new ones."""
        self._ksp.getPC().setReusePreconditioner(True)
        self._kept = True

    def solve(self, b: PETSc.Vec, x: PETSc.Vec, rtol: float) -> Outcome:
        """Solve for x; with new factors as accurately as they allow, whatever ``rtol``.

        Collective.
        """
        if self._kept:
            self._cg.setTolerances(rtol=rtol, max_it=max(self.worth, 1))
            return run(self._cg, b, x)
        outcome = run(self._ksp, b, x)
        self._failed = not outcome.solved
        if outcome.solved and self._left(b, x) > USELESS:
            return Outcome(outcome.iterations, "the solution leaves most of the right-hand side")
        return outcome

    def _left(self, b: PETSc.Vec, x: PETSc.Vec) -> float:
        """Return the relative residual of A x = b, which reveals a singular matrix."""
        assert self._matrix is not None
        image = b.duplicate()
        self._matrix.mult(x, image)
        image.axpy(-1.0, b)
        left = image.norm() / b.norm()
        image.destroy()
        return float(left)

    def destroy(self) -> None:
        """Release memory immediately. Collective."""
        self._cg.destroy()
        self._ksp.destroy()
