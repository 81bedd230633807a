"""Define the operator of a step in the jump basis, A = TᵀKT, and its matrix with held unknowns.

Products with vectors use K and T, so only one matrix is stored in addition. This matrix is for
linear solves; a scaled identity replaces its rows and columns at held unknowns.

A and K differ only in the rows of contact nodes and their neighbours; elsewhere T is the identity.
Therefore only these few rows are multiplied. The module replaces them in K to obtain A, if K has
space for their entries.
"""

from petsc4py import PETSc

import numpy as np
import numpy.typing as npt
from dolfinx import fem, la

from perfplast_fenicsx.arrays import Floats, Ints
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.profiling import phase


class ContactRows:
    """The rows in which A differs from K."""

    def __init__(self, problem: Problem) -> None:
        """Find the rows in which A differs from K. Collective."""
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
        """Transform K into A in place; K must have space for the entries. Collective.

        Args:
            K: Stiffness in nodal unknowns, of type "aij", with the same pattern in each call.
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
    """Return an index set of all columns of a matrix; each rank has the columns that it owns."""
    return PETSc.IS().createStride(
        A.getLocalSize()[1], first=A.getOwnershipRangeColumn()[0], step=1, comm=A.comm
    )


def _moved(T: PETSc.Mat) -> npt.NDArray[np.bool_]:
    """Return which owned unknowns have a row or column of T that differs from the identity.

    Collective.
    """
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
    """Return which owned nodes have a flagged unknown, or share a cell with such a node.

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


class ContactOperator:
    """The operator A = TᵀKT for the current values of K.

    Attributes:
        stiffness: K in nodal unknowns, in blocks.
        matrix: A, with the held unknowns of the last :meth:`hold` eliminated.
    """

    def __init__(self, problem: Problem, stiffness: PETSc.Mat) -> None:
        self.stiffness, self.matrix = stiffness, PETSc.Mat()
        self._T, self._tied = problem.basis.T, problem.basis.tied
        changed = problem.num_pairs or problem.num_tied  # A is a separate matrix
        self._rows = ContactRows(problem) if changed else None
        self._u, self._image, self._y = (problem.create_vector() for _ in range(3))
        self._springs: tuple[Ints, Floats] | None = None

    def add_springs(self, springs: tuple[Ints, Floats] | None) -> None:
        """Set springs at some unknowns, or remove them; the next :meth:`hold` includes them.

        Args:
            springs: Local owned unknowns of one node in each row, −1 where there is no unknown,
                shape (n, k); and their stiffness, shape (n, k, k). None to remove the springs.
        """
        self._springs = springs

    def mult_add(self, y: PETSc.Vec, r: PETSc.Vec, f: PETSc.Vec) -> None:
        """Set f to A y + r. Collective."""
        if self._rows is None:
            self.stiffness.multAdd(y, r, f)
            return
        self._T.mult(y, self._u)
        self.stiffness.mult(self._u, self._image)
        self._T.multTranspose(self._image, self._y)
        f.waxpy(1.0, self._y, r)
        if self._springs is not None:
            index, stiffness = self._springs
            there, local = index >= 0, y.array_r
            values = np.where(there, local[index], 0.0) if index.size else np.zeros(index.shape)
            f.array[index[there]] += np.einsum("nij,nj->ni", stiffness, values)[there]

    @phase("basis change")
    def hold(self, held: Ints) -> None:
        """Form the matrix, with the local owned unknowns ``held`` eliminated. Collective."""
        self.stiffness.convert("aij", self.matrix)
        if self._rows is not None:
            self.matrix.setOption(
                PETSc.Mat.Option.KEEP_NONZERO_PATTERN, True
            )  # copies lose this option
            self._rows.transform(self.matrix)
        if self._springs is not None:
            self._stiffen(*self._springs)
        self.matrix.setOption(PETSc.Mat.Option.SPD, True)
        if self._rows is not None:
            self._take_out(np.concatenate([held, self._tied]))

    def _stiffen(self, index: Ints, stiffness: Floats) -> None:
        """Add the springs to the matrix."""
        first = self.matrix.getOwnershipRange()[0]
        pairs = np.repeat(index[:, :, None], index.shape[1], axis=2)
        row, column = pairs, np.swapaxes(pairs, 1, 2)
        there = (row >= 0) & (column >= 0)
        rows, columns = (place[there].astype(PETSc.IntType) + first for place in (row, column))
        pointer = np.arange(len(rows) + 1, dtype=PETSc.IntType)
        values = stiffness[there]
        self.matrix.setValuesIJV(
            pointer, columns, values, addv=PETSc.InsertMode.ADD_VALUES, rowmap=rows
        )
        self.matrix.assemble()

    def _take_out(self, held: Ints) -> None:
        """Replace the rows and columns of held unknowns by a scaled identity."""
        diagonal = self.matrix.getDiagonal()
        scale = diagonal.sum() / diagonal.getSize()
        diagonal.destroy()
        first = self.matrix.getOwnershipRange()[0]
        self.matrix.zeroRowsColumns((held + first).astype(PETSc.IntType), diag=scale)

    def diagonal(self) -> Floats:
        """Return the diagonal A_ii at this rank's unknowns; only ties are held. Collective."""
        self.hold(np.zeros(0, dtype=np.int32))
        diagonal = self.matrix.getDiagonal()
        entries = np.array(diagonal.array_r)
        diagonal.destroy()
        return entries

    def nodal(self) -> PETSc.Mat:
        """Return K as a matrix of type "aij", which the caller must destroy. Collective."""
        return self.stiffness.convert("aij", PETSc.Mat())
