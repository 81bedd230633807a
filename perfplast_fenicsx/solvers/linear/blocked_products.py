"""Multiply with a symmetric matrix by the blocks of its upper triangle, in C.

The products are limited by memory traffic, which this halves; in single precision it is a quarter.
Single precision is for the smoothers of multigrid, which multiply six times for each product of CG.
It changes the preconditioner by about 1e-7. CG itself, coarse spaces and factors use double
precision.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from petsc4py import PETSc

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.compiled_kernels import compiled
from perfplast_fenicsx.solvers.linear.block_rows import BlockRows, room_of, whole
from perfplast_fenicsx.solvers.linear.blocked_source import source
from perfplast_fenicsx.solvers.linear.csr_arrays import Rows, own_rows


class BlockedProducts:
    """Products with a symmetric matrix, of which only the blocks of the upper triangle are stored.

    Attributes:
        matrix: PETSc's matrix that multiplies.
    """

    def __init__(self, A: PETSc.Mat, precision: type[np.floating] = np.float64) -> None:
        """Allocate memory. Collective.

        Args:
            A: Symmetric matrix of type "aij", with blocks of a supported size.
            precision: Precision of storage and products, float32 or float64.
        """
        size = A.getBlockSize()
        comm = A.comm.tompi4py()
        here, there, columns = own_rows(A)
        self._ghosts, self._scatter = ghosts_of(A, columns)
        kernels, of = compiled(comm, source(precision))[0], (comm, precision, (size, size))
        own = BlockRows(*of, here, A.getLocalSize()[1], upper=True)
        self._here, self._there = _Products(kernels, own, size), None
        if there is not None:
            others = BlockRows(*of, there, self._ghosts.getLocalSize())
            self._there = _Products(kernels, others, size)
        self.matrix = PETSc.Mat().createPython(A.getSizes(), _Called(self.product), comm=A.comm)
        self.matrix.setBlockSize(size)
        self.matrix.setUp()

    def fill(self, A: PETSc.Mat) -> None:
        """Copy the entries of a matrix with the pattern of the first one. Collective."""
        here, there, _ = own_rows(A)
        self._here.fill(here)
        if self._there is not None and there is not None:
            self._there.fill(there)
        self.matrix.stateIncrease()

    def product(self, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Set y to A x. Collective."""
        if self._there is not None:
            self._scatter.begin(x, self._ghosts)
        self._here.take(x.array_r)
        self._here.product()
        if self._there is not None:
            self._scatter.end(x, self._ghosts)
            self._there.take(self._ghosts.array_r)
            self._there.add_to(self._here)
        self._here.give(y.array_w)

    def destroy(self) -> None:
        """Release PETSc's memory. Collective."""
        for thing in (self.matrix, self._ghosts, self._scatter):
            thing.destroy()


@dataclass(frozen=True)
class _Called:
    """The functions that PETSc calls."""

    product: Callable[[PETSc.Vec, PETSc.Vec], None]

    def mult(self, matrix: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Set y to A x."""
        self.product(x, y)


class _Products:
    """Products with blocks of rows, and memory for their vectors."""

    def __init__(self, kernels: Any, of: BlockRows, size: int) -> None:
        self._kernels, self._of, self._size = kernels, of, size
        width = room_of(size)
        self._x, self._y = of.reals(width * of.columns), of.reals(width * of.rows)

    def fill(self, rows: Rows) -> None:
        """Set the entries."""
        self._of.fill(rows)

    def take(self, x: Floats) -> None:
        """Copy the vector to be multiplied."""
        self._kernels.take(self._size, self._of.columns, self._of.vector(x), self._x)

    def product(self) -> None:
        """Multiply, including the blocks' transposes."""
        self._kernels.product(self._size, self._of.rows, *self._of.matrix, self._x, self._y)

    def add_to(self, other: "_Products") -> None:
        """Add the product to another one."""
        self._kernels.add(self._size, self._of.rows, *self._of.matrix, self._x, other._y)

    def give(self, y: Floats) -> None:
        """Copy the product to a vector."""
        self._kernels.give(self._size, self._of.rows, self._y, self._of.vector(y))


def ghosts_of(A: PETSc.Mat, columns: npt.NDArray[np.integer]) -> tuple[PETSc.Vec, PETSc.Scatter]:
    """Return a vector for other ranks' entries, and the scatter that fills it. Collective.

    Args:
        A: Matrix that multiplies the vector.
        columns: Global column numbers of A on other ranks.

    Returns:
        Vector for whole blocks of columns; and the scatter.
    """
    size = A.getBlockSizes()[1]
    ghosts = PETSc.Vec().createSeq(size * whole(len(columns), size), comm=PETSc.COMM_SELF)
    if A.comm.getSize() == 1:
        return ghosts, PETSc.Scatter()
    x = A.createVecRight()
    chosen = PETSc.IS().createGeneral(columns.astype(PETSc.IntType), comm=PETSc.COMM_SELF)
    places = PETSc.IS().createStride(len(columns), step=1, comm=PETSc.COMM_SELF)
    scatter = PETSc.Scatter().create(x, chosen, ghosts, places)
    for thing in (x, chosen, places):
        thing.destroy()
    return ghosts, scatter
