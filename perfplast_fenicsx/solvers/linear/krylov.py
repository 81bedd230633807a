"""Solve systems by a Krylov method with any of PETSc's preconditioners.

The method multiplies with blocks of the upper triangle (:class:`BlockedProducts`), more than twice
as fast; preconditioners use the matrix itself.
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
    """A Krylov method with a preconditioner that may be older than the matrix.

    Attributes:
        name: Name of the solver in messages.
        worth: Number of Krylov iterations that cost about as much as a set-up.
    """

    worth = 12

    def __init__(
        self, comm: MPI.Intracomm, preset: Mapping[str, object], *, parts: bool = False
    ) -> None:
        """Create the solver from the preset and the user's options. Collective.

        Args:
            comm: The ranks.
            preset: Default options, which the user's options override.
            parts: Whether each part of the preconditioner gets its own matrices.
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
        """Return PETSc's preconditioner."""
        return self._ksp.getPC()

    def prepare(self, operator: ContactOperator) -> bool:
        """Do nothing and return True: this method suits any operator."""
        return True

    @phase("linear set-up")
    def set_matrix(self, operator: ContactOperator, held: Ints) -> None:
        """Take the matrix of an operator in which ``held`` is eliminated. Collective."""
        self._matrix = operator.matrix
        if self._products is None:
            self._products = BlockedProducts(operator.matrix)
        self._products.fill(operator.matrix)
        self.attach()

    def attach(self) -> None:
        """Pass the matrices to PETSc's solver, also after a reset of its preconditioner."""
        # PETSc passes its own matrices to a part with the same matrix as the whole
        assert self._products is not None
        product = self._products.matrix
        self._ksp.setOperators(product, product if self._parts else self._matrix)

    def renew(self, flow: PETSc.Vec | None) -> None:
        """Renew the preconditioner at the next solve."""
        self.preconditioner.setReusePreconditioner(False)

    def keep(self) -> None:
        """Solve with the present preconditioner."""
        self.preconditioner.setReusePreconditioner(True)

    def solve(self, b: PETSc.Vec, x: PETSc.Vec, rtol: float) -> Outcome:
        """Solve for x, to ``rtol`` relative to b or the user's smaller tolerance. Collective."""
        self._ksp.setTolerances(rtol=min(rtol, self._least_rtol))
        return run(self._ksp, b, x)

    def destroy(self) -> None:
        """Release memory immediately. Collective."""
        self._ksp.destroy()
        if self._products is not None:
            self._products.destroy()
