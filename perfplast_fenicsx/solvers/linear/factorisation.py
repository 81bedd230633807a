"""Solve systems by factorisation with MUMPS, CHOLMOD or the user's solver; estimate its memory.

If only a few held unknowns change, the change of the matrix has low rank, and CG with the old
factors converges in a few iterations.

The module also estimates the cost of a factorisation, and whether it fits into memory. The estimate
uses MUMPS's analysis, which is fast.

CHOLMOD replaces MUMPS where its factors are faster: on one rank, in 3D. CHOLMOD orders by METIS,
which MUMPS in Debian cannot use. For lower bounds in 3D, a factorisation by CHOLMOD takes three
fifths of the time of MUMPS, and a solve takes half of the time. In plane meshes, with few
operations per entry of the factors, MUMPS is faster (benchmarks/NOTEBOOK.md). CHOLMOD needs a
positive definite matrix, and rounding errors may make a matrix indefinite.
"""

import logging
import math
from collections.abc import Mapping
from dataclasses import dataclass

from mpi4py import MPI
from petsc4py import PETSc

from perfplast_fenicsx.arrays import Ints
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.machine_memory import has_memory, spare_memory
from perfplast_fenicsx.profiling import phase
from perfplast_fenicsx.solvers.linear.contact_operator import ContactOperator
from perfplast_fenicsx.solvers.linear.outcome import Outcome, run
from perfplast_fenicsx.solvers.linear.petsc_calls import forget_factors
from perfplast_fenicsx.solvers.linear.petsc_options import LINEAR, own_prefix, solver_name

log = logging.getLogger(__name__)


OPERATIONS, ENTRIES = 3, 29
"""MUMPS's indices for the operations of the current factorisation, and for the entries of its
factors."""


@dataclass(frozen=True)
class Price:
    """The estimated cost of a factorisation.

    Attributes:
        iterations: Number of multigrid CG iterations that take the same time. Operations run faster
            if there are more per matrix entry, so the estimate is the square root of the number of
            operations per matrix entry. The estimate is accurate to a factor of 2 for linear and
            quadratic elements, for slender and stout bodies, and from 19 to 270 thousand unknowns
            (benchmarks/NOTEBOOK.md).
        fits: Whether the ranks have enough memory.
    """

    iterations: float
    fits: bool


@dataclass(frozen=True)
class Analysis:
    """The estimates of MUMPS before a factorisation.

    Attributes:
        operations: Number of operations of a factorisation on all ranks.
        per_entry: Number of operations per entry of the factors.
        needed: Smallest memory that this rank needs (bytes).
    """

    operations: float
    per_entry: float
    needed: float


def price(ksp: PETSc.KSP, matrix: PETSc.Mat) -> Price:
    """Return the estimated cost of a factorisation by MUMPS. Collective.

    Args:
        ksp: Solver with its options and operators, not set up; the function returns it in this
            state.
        matrix: Matrix that would be factorised.
    """
    comm = ksp.comm.tompi4py()
    found = _analyse(ksp)
    fits = comm.allreduce(found.needed / 1e6 <= spare_memory(comm), MPI.LAND)
    entries = matrix.getInfo(PETSc.Mat.InfoType.GLOBAL_SUM)["nz_used"]
    return Price(math.sqrt(found.operations / max(entries, 1)), fits)


def entries_of(factors: PETSc.Mat, which: int) -> float:
    """Return MUMPS's number of entries with index ``which``; MUMPS stores millions negatively."""
    entries = factors.getMumpsInfog(which)
    return float(entries if entries >= 0 else -1e6 * entries)


def _analyse(ksp: PETSc.KSP) -> Analysis:
    """Return MUMPS's analysis of a matrix. Collective.

    The function gives MUMPS almost no memory, so that MUMPS stops after the analysis.
    """
    pc = ksp.getPC()
    pc.setFactorSetUpSolverType()
    factors = pc.getFactorMatrix()
    # MUMPS's indices for the additional working space (%), the memory that a rank needs, and the
    # memory that it may use (MB).
    room, needed, most = 14, 15, 23
    factors.setMumpsIcntl(most, 1)
    ksp.setUp()
    least = factors.getMumpsInfo(needed) * 1e6 / (1 + factors.getMumpsIcntl(room) / 100)
    # MUMPS's indices for the operations of a factorisation, and for the entries of its factors.
    estimated_operations, estimated_entries = 1, 20
    operations = factors.getMumpsRinfog(estimated_operations)
    entries = entries_of(factors, estimated_entries)
    forget_factors(ksp)
    return Analysis(operations, operations / max(entries, 1), least)


class TooLarge(InputError):
    """Raised if a factorisation does not fit into memory."""


def check_memory(ksp: PETSc.KSP) -> Analysis | None:
    """Refuse a factorisation that needs more memory than is available, before it starts.

    Collective.

    Args:
        ksp: Solver with its options and operators, not set up; the function returns it in this
            state.

    Returns:
        MUMPS's analysis; None for other solvers, whose memory the function does not check.

    Raises:
        TooLarge: If the factorisation needs more; the message gives the required and the available
            memory.
    """
    pc, (matrix, _) = ksp.getPC(), ksp.getOperators()
    if pc.getType() not in ("cholesky", "lu") or pc.getFactorSolverType() != "mumps":
        return None
    found = _analyse(ksp)
    enough, needed, has = has_memory(ksp.comm.tompi4py(), found.needed)
    if not enough:
        raise TooLarge(
            f"a factorisation for {matrix.getSize()[0]} unknowns needs at least "
            f"{needed / 2**30:.3g} GiB of memory, but {has / 2**30:.3g} GiB are available; "
            "use a coarser mesh, or more machines."
        )
    return found


DIRECT = {
    "ksp_type": "preonly",
    "pc_type": "cholesky",
    "pc_factor_mat_solver_type": "mumps",
    "mat_mumps_icntl_14": 100,  # additional working space (%), which parallel pivoting may need
}


USELESS = 0.1
"""A solution with a larger relative residual is rejected."""


class Factorisation:
    """A factorisation of the operator's matrix, with held unknowns eliminated.

    Attributes:
        name: Name of the solver in messages.
    """

    def __init__(
        self, comm: MPI.Intracomm, preset: Mapping[str, object] = DIRECT, heed: bool = True
    ) -> None:
        """Create the solver. Collective.

        Args:
            comm: Communicator of the ranks.
            preset: Default options.
            heed: Whether the options of the user apply.
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
        """Return how many iterations with old factors cost as much as new factors.

        The result is 0 if the number is below five, or if the solver is not MUMPS.
        """
        pc = self._ksp.getPC()
        if pc.getFactorSolverType() != "mumps":
            return 0
        factors = pc.getFactorMatrix()
        entries = entries_of(factors, ENTRIES)
        # Time of CG per entry of the factors, in operations of a factorisation; these operations
        # work in cache.
        balance = 40.0
        iterations = int(factors.getMumpsRinfog(OPERATIONS) / (balance * max(entries, 1)))
        # Factorisations that cost less than this number of iterations are never replaced by CG.
        least_worth = 5
        return iterations if iterations >= least_worth else 0

    def price(self) -> Price:
        """Return the estimated cost of a factorisation, without performing it. Collective."""
        assert self._matrix is not None
        return price(self._ksp, self._matrix)

    def prepare(self, operator: ContactOperator) -> bool:
        """Do nothing, and return True: a factorisation suits any operator."""
        return True

    @phase("linear set-up")
    def set_matrix(self, operator: ContactOperator, held: Ints) -> None:
        """Set the matrix of an operator in which ``held`` is eliminated. Collective."""
        self._matrix = operator.matrix
        self._ksp.setOperators(self._matrix)
        self._cg.setOperators(self._matrix)

    def renew(self, flow: PETSc.Vec | None) -> None:
        """Request a new factorisation at the next solve."""
        if self._failed:
            forget_factors(self._ksp)
            self._failed = False
        self._ksp.getPC().setReusePreconditioner(False)
        self._kept = False

    def keep(self) -> None:
        """Use CG with the current factors, as long as this costs less than new factors."""
        self._ksp.getPC().setReusePreconditioner(True)
        self._kept = True

    def solve(self, b: PETSc.Vec, x: PETSc.Vec, rtol: float) -> Outcome:
        """Solve for x to ``rtol``; with new factors, as accurately as the factors allow.

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


class SupernodalFactors:
    """Factors by CHOLMOD, which are used until CHOLMOD cannot factorise a matrix."""

    def __init__(self) -> None:
        """Start without factors."""
        self._ksp: PETSc.KSP | None = None

    def take_over(self, ksp: PETSc.KSP, analysis: Analysis | None, prefix: str) -> None:
        """Use CHOLMOD from now on if it is faster and the user chose no solver. Collective.

        Args:
            ksp: MUMPS solver with its operators.
            analysis: MUMPS's analysis; None if there is none.
            prefix: Prefix of the options by which users choose a solver.
        """
        # Operations per entry of the factors from which CHOLMOD is faster.
        least = 300.0
        asked = PETSc.Options().hasName(f"{prefix}pc_factor_mat_solver_type")
        if ksp.comm.getSize() > 1 or analysis is None or asked:
            return
        if analysis.per_entry < least or not PETSc.Sys.hasExternalPackage("cholmod"):
            return
        self._ksp = PETSc.KSP().create(ksp.comm)
        self._ksp.setType(PETSc.KSP.Type.PREONLY)
        quiet = {"mat_cholmod_print": 0}  # no messages on matrices that are indefinite
        self._ksp.setOptionsPrefix(own_prefix(self, prefix, quiet, heed=False))
        pc = self._ksp.getPC()
        pc.setType(PETSc.PC.Type.CHOLESKY)
        pc.setFactorSolverType("cholmod")

    def factorise(self, matrix: PETSc.Mat) -> PETSc.KSP | None:
        """Factorise a matrix. Collective.

        Returns:
            A solver with the factors; None if CHOLMOD is not used or has failed, and then also in
            later calls.
        """
        if self._ksp is None:
            return None
        try:
            self._ksp.setOperators(matrix)
            self._ksp.setUp()
        except PETSc.Error as failure:  # indefinite, or too large for CHOLMOD's integers
            log.debug("MUMPS replaces CHOLMOD for factorisations (PETSc's error %d)", failure.ierr)
            self.destroy()
        return self._ksp

    def destroy(self) -> None:
        """Release the memory of PETSc objects. Collective."""
        if self._ksp is not None:
            self._ksp.destroy()
            self._ksp = None
