"""Precondition F by B_D S B_Dᵀ, with the stiffness S of pieces at their interfaces.

S is the Schur complement, in which the interior of each piece follows its interfaces ("Dirichlet");
each application takes one solve with the factors of the interiors. B_D distributes a jump among the
copies of a node by their stiffness: stiffer copies get a smaller part, so that plastic pieces do
not affect the convergence (D. Rixen, C. Farhat, Int. J. Numer. Meth. Engng 44 (1999), 489).
"""

from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.contact.rows.rigid_motions import nodes_of
from perfplast_fenicsx.solvers.linear.linear_solver import LinearFailure
from perfplast_fenicsx.solvers.tfeti.dual_operator import DualOperator
from perfplast_fenicsx.solvers.tfeti.gluing import Gluing
from perfplast_fenicsx.solvers.tfeti.subdomains import Factors, TornStiffness


class DirichletPreconditioner:
    """The preconditioner B_D S B_Dᵀ with Schur complements. All methods are collective."""

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
        """Set a new K, or the same K with new values.

        Raises:
            LinearFailure: If the interior of a piece cannot be factorised.
        """
        self._matrix = K.matrix.createSubMatrix(self._blocks, self._blocks, self._matrix)
        failure = self._factors.make(self._matrix)
        failures = [text for text in self._dual.comm.allgather(failure) if text is not None]
        if failures:
            raise LinearFailure(
                f"the interior of a subdomain could not be factorised ({failures[0]})"
            )
        diagonal = K.matrix.getDiagonal()
        self._stiff = diagonal.array_r.copy()
        diagonal.destroy()
        self._sums = self._summed(self._stiff)

    def apply(self, jumps: Floats) -> Floats:
        """Return B_D S B_Dᵀ w for ``jumps`` w."""
        dual = self._dual
        glued = np.zeros_like(jumps)
        glued[self._glue] = jumps[self._glue]
        u = dual.forces(jumps) - self._spread(self._stiff * dual.forces(glued))
        forces = self._schur(u)
        found = dual.rows(forces)
        found[self._glue] = dual.rows(forces - self._stiff * self._spread(forces))[self._glue]
        return found

    def _schur(self, u: Floats) -> Floats:
        """Return S u for u that is zero in interiors; the result in interiors has no meaning."""
        K = self._dual.stiffness
        forces = K.multiply(u)
        following = np.zeros_like(u)
        following[self._inside] = self._factors.solve(forces[self._inside])
        return forces - K.multiply(following)

    def _summed(self, torn: Floats) -> Floats:
        """Return the sums over the copies of each node."""
        self._torn.array[:] = torn
        self._copies.multTranspose(self._torn, self._nodal)
        sums: Floats = self._nodal.array_r.copy()
        return sums

    def _spread(self, torn: Floats) -> Floats:
        """Return at each copy the sum over the copies of its node, over their total stiffness."""
        self._nodal.array[:] = self._summed(torn) / self._sums
        self._copies.mult(self._nodal, self._torn)
        spread: Floats = self._torn.array_r.copy()
        return spread
