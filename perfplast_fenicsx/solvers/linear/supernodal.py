"""Use CHOLMOD's factors instead of MUMPS's where they are faster: on one rank, in space.

CHOLMOD orders by METIS, which Debian's MUMPS cannot. The lower bound's matrices in space are
factorised in three fifths of the time, and solves take half of the time. In the plane, with few
operations per entry of the factors, MUMPS is faster (benchmarks/NOTEBOOK.md). CHOLMOD needs a
positive definite matrix, which rounding may prevent.
"""

import logging

from petsc4py import PETSc

from perfplast_fenicsx.solvers.linear.mumps_memory import Analysis
from perfplast_fenicsx.solvers.linear.petsc_options import own_prefix

log = logging.getLogger(__name__)


class SupernodalFactors:
    """Factors by CHOLMOD, until a matrix is found not to be positive definite."""

    def __init__(self) -> None:
        """Start without factors."""
        self._ksp: PETSc.KSP | None = None

    def take_over(self, ksp: PETSc.KSP, analysis: Analysis | None, prefix: str) -> None:
        """Create factors from now on if that is faster. Collective.

        Args:
            ksp: Solver of MUMPS, with its operators.
            analysis: Analysis of MUMPS; None without one.
            prefix: Prefix of the options by which users select a solver.
        """
        # operations per entry of the factors from which CHOLMOD is faster
        least = 300.0
        asked = PETSc.Options().hasName(f"{prefix}pc_factor_mat_solver_type")
        if ksp.comm.getSize() > 1 or analysis is None or asked:
            return
        if analysis.per_entry < least or not PETSc.Sys.hasExternalPackage("cholmod"):
            return
        self._ksp = PETSc.KSP().create(ksp.comm)
        self._ksp.setType(PETSc.KSP.Type.PREONLY)
        quiet = {"mat_cholmod_print": 0}  # it prints messages on matrices that it cannot factorise
        self._ksp.setOptionsPrefix(own_prefix(self, prefix, quiet, heed=False))
        pc = self._ksp.getPC()
        pc.setType(PETSc.PC.Type.CHOLESKY)
        pc.setFactorSolverType("cholmod")

    def factorise(self, matrix: PETSc.Mat) -> PETSc.KSP | None:
        """Factorise a matrix. Collective.

        Returns:
            A solver with the factors; None if there are none, also in all later calls.
        """
        if self._ksp is None:
            return None
        try:
            self._ksp.setOperators(matrix)
            self._ksp.setUp()
        except PETSc.Error as failure:  # not positive definite, or too large for its integers
            log.debug("MUMPS replaces CHOLMOD for factorisations (PETSc's error %d)", failure.ierr)
            self.destroy()
        return self._ksp

    def destroy(self) -> None:
        """Release PETSc's memory. Collective."""
        if self._ksp is not None:
            self._ksp.destroy()
            self._ksp = None
