"""Compute the rows of A = TᵀKT that differ from those of K: contact nodes and neighbours.

Elsewhere T is the identity. So only these few rows are multiplied, and A is K with these rows
replaced, if K has space for their entries.
"""

from petsc4py import PETSc

import numpy as np
import numpy.typing as npt
from dolfinx import fem, la

from perfplast_fenicsx.problem.problem import Problem


class ContactRows:
    """The rows of A that differ from those of K."""

    def __init__(self, problem: Problem) -> None:
        """Find the rows. Collective."""
        self._T = problem.basis.T
        self._whole = every_column(self._T)
        nodes = np.flatnonzero(_near(problem.V, _moved(self._T)))
        bs = problem.V.dofmap.index_map_bs
        rows = (nodes[:, None] * bs + np.arange(bs)).ravel() + self._T.getOwnershipRange()[0]
        self._chosen = PETSc.IS().createGeneral(rows.astype(PETSc.IntType), comm=self._T.comm)
        square = self._T.createSubMatrix(self._chosen, self._chosen)
        self._left = square.transpose(PETSc.Mat())
        square.destroy()
        self._part, self._right, self._both = PETSc.Mat(), PETSc.Mat(), PETSc.Mat()

    def transform(self, K: PETSc.Mat) -> None:
        """Transform K to A in place; K must have space for the entries. Collective.

        Args:
            K: Stiffness in nodal unknowns, of type "aij"; always with the same pattern.
        """
        if self._part:
            K.createSubMatrix(self._chosen, self._whole, self._part)
            self._part.matMult(self._T, self._right)
            self._left.matMult(self._right, self._both)
        else:
            self._part = K.createSubMatrix(self._chosen, self._whole)
            self._right = self._part.matMult(self._T)
            self._both = self._left.matMult(self._right)
        K.zeroRows(self._chosen, diag=0.0)
        K.setValuesIJV(*self._both.getValuesCSR(), rowmap=self._chosen.getIndices())
        K.assemble()


def every_column(A: PETSc.Mat) -> PETSc.IS:
    """Return all columns of a matrix, as distributed, for the selection of rows."""
    return PETSc.IS().createStride(
        A.getLocalSize()[1], first=A.getOwnershipRangeColumn()[0], step=1, comm=A.comm
    )


def _moved(T: PETSc.Mat) -> npt.NDArray[np.bool_]:
    """Return owned unknowns whose row or column of T is not that of the identity. Collective."""
    pointer, columns, values = T.getValuesCSR()
    first, last = T.getOwnershipRange()
    row = np.repeat(np.arange(first, last), np.diff(pointer))
    other = np.abs(np.where(columns == row, values - 1, values))
    N = PETSc.Mat().createAIJ(T.getSizes(), csr=(pointer, columns, other), comm=T.comm)
    ones, sums = N.createVecs()
    ones.set(1.0)
    N.mult(ones, sums)
    by_row = sums.array.copy()
    N.multTranspose(ones, sums)
    moved: npt.NDArray[np.bool_] = by_row + sums.array_r > 0
    for thing in (N, ones, sums):
        thing.destroy()
    return moved


def _near(V: fem.FunctionSpace, unknowns: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """Return owned nodes that share a cell with the node of one of these unknowns, or are its node.

    Collective.
    """
    index_map = V.dofmap.index_map
    nodes = la.vector(index_map, 1, dtype=np.int64)
    owned = index_map.size_local
    nodes.array[:owned] = unknowns.reshape(owned, V.dofmap.index_map_bs).any(axis=1)
    nodes.scatter_forward()
    cells = V.dofmap.list
    near = np.unique(cells[nodes.array[cells].any(axis=1)])
    nodes.array[near] = 1
    nodes.scatter_reverse(la.InsertMode.add)
    return np.asarray(nodes.array[:owned]) > 0
