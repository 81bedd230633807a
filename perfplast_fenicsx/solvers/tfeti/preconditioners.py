"""Preconditioners B_D S B_Dᵀ of F, with the stiffness S of pieces as their faces feel it.

S is the Schur complement, in which the inside of each piece follows its faces ("Dirichlet"): one
solution with factors of the insides an application. B_D shares a jump among the copies of a node by
their stiffness, the stiffer the less, so that pieces that flow do not spoil others (D. Rixen,
C. Farhat, Int. J. Numer. Meth. Engng 44 (1999), 489).
"""

from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.contact.rows.rigid_motions import nodes_of
from perfplast_fenicsx.solvers.linear.linear_solver import LinearFailure
from perfplast_fenicsx.solvers.tfeti.dual_operator import DualOperator
from perfplast_fenicsx.solvers.tfeti.factors import Factors
from perfplast_fenicsx.solvers.tfeti.gluing import Gluing
from perfplast_fenicsx.solvers.tfeti.torn_stiffness import TornStiffness


class DirichletPreconditioner:
    """B_D S B_Dᵀ by Schur complements. All methods are collective."""

    def __init__(self, dual: DualOperator, gluing: Gluing, gdim: int) -> None:
        self._dual, self._copies = dual, gluing.copies
        self._glue = slice(0, gluing.num_glue)
        self._nodal, self._torn = gluing.copies.createVecs()
        size = self._torn.getLocalSize()
        inside = np.setdiff1d(np.arange(size // gdim), nodes_of(gluing.B, gdim))
        self._inside = (inside[:, None] * gdim + np.arange(gdim)).ravel()
        self._blocks = PETSc.IS().createBlock(
            gdim, inside.astype(PETSc.IntType), comm=PETSc.COMM_SELF
        )
        self._factors = Factors()
        self._matrix: PETSc.Mat | None = None
        self._stiff: Floats = np.ones(size)
        self._sums: Floats = np.ones(self._nodal.getLocalSize())

    def set_stiffness(self, K: TornStiffness) -> None:
        """Take a new K, or one with new values.

        Raises:
            LinearFailure: If the inside of a piece has no factors.
        """
        self._matrix = K.matrix.createSubMatrix(self._blocks, self._blocks, self._matrix)
        failure = self._factors.make(self._matrix)
        failures = [text for text in self._dual.comm.allgather(failure) if text is not None]
        if failures:
            raise LinearFailure(
                f"the inside of a subdomain could not be factorised ({failures[0]})"
            )
        diagonal = K.matrix.getDiagonal()
        self._stiff = diagonal.array_r.copy()
        diagonal.destroy()
        self._sums = self._summed(self._stiff)

    def apply(self, jumps: Floats) -> Floats:
        """B_D S B_Dᵀ w."""
        dual = self._dual
        glued = np.zeros_like(jumps)
        glued[self._glue] = jumps[self._glue]
        u = dual.forces(jumps) - self._spread(self._stiff * dual.forces(glued))
        forces = self._schur(u)
        found = dual.rows(forces)
        found[self._glue] = dual.rows(forces - self._stiff * self._spread(forces))[self._glue]
        return found

    def _schur(self, u: Floats) -> Floats:
        """S u for u that is zero inside; what it has there is of no use."""
        K = self._dual.stiffness
        forces = K.multiply(u)
        following = np.zeros_like(u)
        following[self._inside] = self._factors.solve(forces[self._inside])
        return forces - K.multiply(following)

    def _summed(self, torn: Floats) -> Floats:
        """Over the copies of each node."""
        self._torn.array[:] = torn
        self._copies.multTranspose(self._torn, self._nodal)
        sums: Floats = self._nodal.array_r.copy()
        return sums

    def _spread(self, torn: Floats) -> Floats:
        """Sums over copies, relative to their stiffness, on each copy."""
        self._nodal.array[:] = self._summed(torn) / self._sums
        self._copies.mult(self._nodal, self._torn)
        spread: Floats = self._torn.array_r.copy()
        return spread
