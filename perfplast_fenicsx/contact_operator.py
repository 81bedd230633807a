"""The operator of a step in the contact basis, A = TᵀKT, with unknowns held where it is a matrix.

Its products with vectors are made of those with K and T, so that one matrix is enough: the one that
is solved with, in which rows and columns of held unknowns are those of the identity times a scale.
"""

from petsc4py import PETSc

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.petsc_options import default
from perfplast_fenicsx.phases import phase
from perfplast_fenicsx.problem import Problem

LARGE = 500_000
"""From so many unknowns on memory counts for more than a tenth of the time."""


class ContactOperator:
    """A = TᵀKT for the present values of K.

    Attributes:
        stiffness: K, in nodal unknowns.
        matrix: A with the unknowns held that :meth:`hold` was last called with.
    """

    def __init__(self, problem: Problem, stiffness: PETSc.Mat) -> None:
        self.stiffness, self.matrix = stiffness, PETSc.Mat()
        self._T = problem.basis.T
        self._contact = problem.num_pairs > 0
        self._u, self._image, self._y = (problem.load.duplicate() for _ in range(3))

    def mult_add(self, y: PETSc.Vec, r: PETSc.Vec, f: PETSc.Vec) -> None:
        """Set f to A y + r. Collective."""
        if not self._contact:
            self.stiffness.multAdd(y, r, f)
            return
        self._T.mult(y, self._u)
        self.stiffness.mult(self._u, self._image)
        self._T.multTranspose(self._image, self._y)
        f.waxpy(1.0, self._y, r)

    @phase("basis change")
    def hold(self, held: npt.NDArray[np.int32]) -> None:
        """Form the matrix with the local (owned) unknowns ``held`` taken out. Collective."""
        if not self._contact:
            self.matrix = self.stiffness
        elif self.matrix:
            self.stiffness.PtAP(self._T, self.matrix)
        else:
            self.matrix = self._product()
            self.matrix.setOption(PETSc.Mat.Option.KEEP_NONZERO_PATTERN, True)
        self.matrix.setOption(PETSc.Mat.Option.SPD, True)
        if not self._contact:
            return
        diagonal = self.matrix.getDiagonal()
        scale = diagonal.sum() / diagonal.getSize()
        diagonal.destroy()
        first = self.matrix.getOwnershipRange()[0]
        self.matrix.zeroRowsColumns((held + first).astype(PETSc.IntType), diag=scale)

    def _product(self) -> PETSc.Mat:
        """TᵀKT for the first time."""
        if self._T.comm.size == 1 or self._T.getSize()[0] < LARGE:
            return self.stiffness.PtAP(self._T)
        with default("matptap_via", "allatonce"):  # the usual one keeps K T, and more
            return self.stiffness.PtAP(self._T)
