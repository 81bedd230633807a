"""CHOLMOD's factors, in place of MUMPS's where they are made sooner: on one rank, in space.

CHOLMOD orders by METIS, which MUMPS as Debian has it cannot. The lower bound's matrices in space
are factorised in three fifths of the time, and systems solved in half of it. In the plane, where
there are few operations for an entry of the factors, MUMPS is the quicker one
(benchmarks/NOTEBOOK.md). It wants a matrix that is positive definite, and rounding may leave none.
"""

import logging

from petsc4py import PETSc

from perfplast_fenicsx.solvers.linear.mumps_memory import Analysis
from perfplast_fenicsx.solvers.linear.petsc_options import own_prefix

log = logging.getLogger(__name__)


class SupernodalFactors:
    """Factors by CHOLMOD, until a matrix turns out not to be positive definite."""

    def __init__(self) -> None:
        """Make nothing yet."""
        self._ksp: PETSc.KSP | None = None

    def take_over(self, ksp: PETSc.KSP, analysis: Analysis | None, prefix: str) -> None:
        """Make factors from now on where that takes less time. Collective.

        Args:
            ksp: Solver of MUMPS, with its operators.
            analysis: Analysis of MUMPS; None without one.
            prefix: Prefix of the options by which users select a solver.
        """
        # operations for an entry of the factors from which on CHOLMOD is the quicker one
        least = 300.0
        asked = PETSc.Options().hasName(f"{prefix}pc_factor_mat_solver_type")
        if ksp.comm.getSize() > 1 or analysis is None or asked:
            return
        if analysis.per_entry < least or not PETSc.Sys.hasExternalPackage("cholmod"):
            return
        self._ksp = PETSc.KSP().create(ksp.comm)
        self._ksp.setType(PETSc.KSP.Type.PREONLY)
        quiet = {"mat_cholmod_print": 0}  # it writes to the terminal of matrices it cannot take
        self._ksp.setOptionsPrefix(own_prefix(self, prefix, quiet, heed=False))
        pc = self._ksp.getPC()
        pc.setType(PETSc.PC.Type.CHOLESKY)
        pc.setFactorSolverType("cholmod")

    def factorise(self, matrix: PETSc.Mat) -> PETSc.KSP | None:
        """Factorise a matrix. Collective.

        Returns:
            What solves systems with it; None where there are no such factors, then and ever after.
        """
        if self._ksp is None:
            return None
        try:
            self._ksp.setOperators(matrix)
            self._ksp.setUp()
        except PETSc.Error as failure:  # not positive definite, or too large for its integers
            log.debug("MUMPS factorises in place of CHOLMOD (PETSc's error %d)", failure.ierr)
            self.destroy()
        return self._ksp

    def destroy(self) -> None:
        """Give PETSc's memory back. Collective."""
        if self._ksp is not None:
            self._ksp.destroy()
            self._ksp = None
