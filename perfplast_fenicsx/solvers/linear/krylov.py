"""Solve systems by a Krylov method with any PETSc preconditioner.

The Krylov method multiplies by the blocks of the upper triangle (:class:`BlockedProducts`), which
is more than twice as fast as multiplying by the full matrix. Preconditioners use the full matrix.
"""

from collections.abc import Mapping

from mpi4py import MPI
from petsc4py import PETSc

from perfplast_fenicsx.arrays import Ints
from perfplast_fenicsx.profiling import phase
from perfplast_fenicsx.solvers.linear.blocked_products import BlockedProducts
from perfplast_fenicsx.solvers.linear.contact_operator import ContactOperator
from perfplast_fenicsx.solvers.linear.outcome import Outcome, run
from perfplast_fenicsx.solvers.linear.petsc_options import LINEAR, own_prefix, solver_name


class Krylov:
    """A Krylov method with a preconditioner that may belong to an earlier matrix.

    Attributes:
        name: Name of the solver in messages.
        worth: Number of Krylov iterations that cost about as much as a set-up.
    """

    worth = 12

    def __init__(
        self, comm: MPI.Intracomm, preset: Mapping[str, object], *, parts: bool = False
    ) -> None:
        """Create the solver from the preset and the options of the user. Collective.

        Args:
            comm: Communicator of the ranks.
            preset: Default options, which options of the user override.
            parts: Whether each part of the preconditioner has its own matrices.
        """
        prefix = own_prefix(self, LINEAR, preset)
        self._ksp = PETSc.KSP().create(comm)
        self._ksp.setOptionsPrefix(prefix)
        self._ksp.setFromOptions()
        self.name = solver_name(self._ksp.getType(), self.preconditioner.getType())
        asked = PETSc.Options(prefix).hasName("ksp_rtol")
        self._least_rtol = self._ksp.getTolerances()[0] if asked else 1.0
        self._parts = parts
        self._matrix: PETSc.Mat | None = None
        self._products: BlockedProducts | None = None

    @property
    def preconditioner(self) -> PETSc.PC:
        """Return the PETSc preconditioner."""
        return self._ksp.getPC()

    def prepare(self, operator: ContactOperator) -> bool:
        """Do nothing, and return True: this method suits any operator."""
        return True

    @phase("linear set-up")
    def set_matrix(self, operator: ContactOperator, held: Ints) -> None:
        """Set the matrix of an operator in which ``held`` is eliminated. Collective."""
        self._matrix = operator.matrix
        if self._products is None:
            self._products = BlockedProducts(operator.matrix)
        self._products.fill(operator.matrix)
        self.attach()

    def attach(self) -> None:
        """Pass the matrices to the PETSc solver; needed again if its preconditioner is reset."""
        # PETSc overwrites the matrices of a part of the preconditioner if the part has the same
        # matrix as the whole preconditioner.
        assert self._products is not None
        product = self._products.matrix
        self._ksp.setOperators(product, product if self._parts else self._matrix)

    def renew(self, flow: PETSc.Vec | None) -> None:
        """Request a new preconditioner at the next solve."""
        self.preconditioner.setReusePreconditioner(False)

    def keep(self) -> None:
        """Use the current preconditioner in the next solves."""
        self.preconditioner.setReusePreconditioner(True)

    def solve(self, b: PETSc.Vec, x: PETSc.Vec, rtol: float) -> Outcome:
        """Solve for x, to ``rtol`` relative to b or to a smaller tolerance of the user.

        Collective.
        """
        self._ksp.setTolerances(rtol=min(rtol, self._least_rtol))
        return run(self._ksp, b, x)

    def destroy(self) -> None:
        """Release memory immediately. Collective."""
        self._ksp.destroy()
        if self._products is not None:
            self._products.destroy()
