"""Systems solved by a factorisation: MUMPS Cholesky, unless users ask for another one."""

from collections.abc import Mapping

from mpi4py import MPI
from petsc4py import PETSc

from perfplast_fenicsx.arrays import Ints
from perfplast_fenicsx.profiling import phase
from perfplast_fenicsx.solvers.linear.contact_operator import ContactOperator
from perfplast_fenicsx.solvers.linear.outcome import Outcome, run
from perfplast_fenicsx.solvers.linear.petsc_options import LINEAR, own_prefix, solver_name

DIRECT = {
    "ksp_type": "preonly",
    "pc_type": "cholesky",
    "pc_factor_mat_solver_type": "mumps",
    "mat_mumps_icntl_14": 100,  # more room to work in (%): pivoting in parallel may need it
}

USELESS = 0.1
"""A solution that leaves more of the right-hand side is none."""


class Factorisation:
    """A factorisation of the operator with its held unknowns.

    Attributes:
        name: What is used, for people.
    """

    def __init__(
        self, comm: MPI.Intracomm, preset: Mapping[str, object] = DIRECT, heed: bool = True
    ) -> None:
        """Create the solver. Collective.

        Args:
            comm: The ranks.
            preset: Options that hold where the user says nothing.
            heed: Whether the user's options count.
        """
        self._ksp = PETSc.KSP().create(comm)
        self._ksp.setOptionsPrefix(own_prefix(LINEAR, preset, heed))
        self._ksp.setFromOptions()
        self.name = solver_name(self._ksp.getType(), self._ksp.getPC().getType())
        self._matrix: PETSc.Mat | None = None

    def prepare(self, operator: ContactOperator) -> bool:
        """Nothing is to be made of K alone; it always suits."""
        return True

    @phase("linear set-up")
    def set_matrix(self, operator: ContactOperator, held: Ints) -> None:
        """Take the matrix of an operator, formed with ``held`` taken out. Collective."""
        self._matrix = operator.matrix
        self._ksp.setOperators(self._matrix)

    def renew(self, flow: PETSc.Vec | None) -> None:
        """Factorise at the next solve."""
        self._ksp.getPC().setReusePreconditioner(False)

    def keep(self) -> None:
        """Solve with the factors there are."""
        self._ksp.getPC().setReusePreconditioner(True)

    def solve(self, b: PETSc.Vec, x: PETSc.Vec, rtol: float) -> Outcome:
        """Solve for x, as well as factors allow whatever ``rtol`` asks. Collective."""
        outcome = run(self._ksp, b, x)
        if outcome.solved and self._left(b, x) > USELESS:
            return Outcome(outcome.iterations, "the solution leaves most of the right-hand side")
        return outcome

    def _left(self, b: PETSc.Vec, x: PETSc.Vec) -> float:
        """Share of b that A x misses: a factorisation of a singular matrix may go unnoticed."""
        assert self._matrix is not None
        image = b.duplicate()
        self._matrix.mult(x, image)
        image.axpy(-1.0, b)
        left = image.norm() / b.norm()
        image.destroy()
        return float(left)

    def destroy(self) -> None:
        """Give back memory at once. Collective."""
        self._ksp.destroy()
