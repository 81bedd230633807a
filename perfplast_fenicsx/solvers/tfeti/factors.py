"""Compute Cholesky factors of a matrix on only this rank."""

from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.solvers.linear.failed_factors import forget_factors
from perfplast_fenicsx.solvers.linear.petsc_options import SUBDOMAINS, own_prefix


class Factors:
    """Factors of one pattern, updated for new values."""

    def __init__(self) -> None:
        self._ksp = PETSc.KSP().create(PETSc.COMM_SELF)
        preset = {
            "ksp_type": "preonly",
            "pc_type": "cholesky",
            "pc_factor_mat_solver_type": "mumps",
        }
        self._ksp.setOptionsPrefix(own_prefix(self, SUBDOMAINS, preset))
        self._ksp.setFromOptions()
        self._b, self._x = PETSc.Vec(), PETSc.Vec()

    def make(self, A: PETSc.Mat) -> str | None:
        """Factorise, and return why this fails, or None.

        Returns:
            Why there are no factors; None if there are.
        """
        if not A.getSize()[0]:
            return None
        if not self._x:
            self._x, self._b = A.createVecs()
        pc = self._ksp.getPC()
        pc.setReusePreconditioner(False)
        self._ksp.setOperators(A)
        self._ksp.setUp()
        pc.setReusePreconditioner(True)  # independent of later changes of A
        if pc.getFailedReason():
            forget_factors(self._ksp)
            return "a pivot is zero"
        return None

    def solve(self, b: Floats) -> Floats:
        """Return the solution of A x = b, same shape."""
        if not b.size:
            return np.zeros(0)
        self._b.array[:] = b
        self._ksp.solve(self._b, self._x)
        solution: Floats = self._x.array_r.copy()
        return solution
