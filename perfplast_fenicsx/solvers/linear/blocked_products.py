"""Products with a symmetric matrix that keep the blocks of its upper triangle, in C.

They are bound by what comes from memory, of which this is half; in single precision a quarter. That
is for the smoothers of multigrid, which multiply six times for each product of CG: what it changes
in a preconditioner is of the order of 1e-7 of what that gives. CG itself, coarse spaces and factors
keep to double precision.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from petsc4py import PETSc

import numpy as np
import numpy.typing as npt
from cffi import FFI

from perfplast_fenicsx.arrays import Floats, Ints, Longs
from perfplast_fenicsx.compiled_kernels import compiled
from perfplast_fenicsx.solvers.linear.blocked_source import sizes, source
from perfplast_fenicsx.solvers.linear.csr_arrays import Rows, own_rows


class BlockedProducts:
    """Products with a symmetric matrix; of its blocks those of the upper triangle are kept.

    Attributes:
        matrix: PETSc's object that multiplies.
    """

    def __init__(self, A: PETSc.Mat, precision: type[np.floating] = np.float64) -> None:
        """Make room. Collective.

        Args:
            A: Symmetric, of type "aij", with blocks of one of the sizes that kernels have.
            precision: Of what is kept and multiplied, float32 or float64.
        """
        size = A.getBlockSize()
        assert size in sizes(), f"no kernel for blocks of {size}"
        comm = A.comm.tompi4py()
        here, there, columns = own_rows(A)
        code = compiled(comm, source(precision))
        self._here = _Blocks(code, precision, size, here, upper=True)
        self._there = None
        if there is not None:
            self._there = _Blocks(code, precision, size, there, upper=False)
        self._ghosts, self._scatter = ghosts_of(A, columns)
        self.matrix = PETSc.Mat().createPython(A.getSizes(), _Called(self.product), comm=A.comm)
        self.matrix.setBlockSize(size)
        self.matrix.setUp()

    def fill(self, A: PETSc.Mat) -> None:
        """Take the entries of a matrix with the pattern of the first one. Collective."""
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
        """Give PETSc's memory back. Collective."""
        for thing in (self.matrix, self._ghosts, self._scatter):
            thing.destroy()


@dataclass(frozen=True)
class _Called:
    """What PETSc calls."""

    product: Callable[[PETSc.Vec, PETSc.Vec], None]

    def mult(self, matrix: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Set y to A x."""
        self.product(x, y)


class _Blocks:
    """Blocks of compressed rows, and room for the vectors of their products."""

    def __init__(
        self,
        code: tuple[Any, FFI],
        precision: type[np.floating],
        size: int,
        rows: Rows,
        *,
        upper: bool,
    ) -> None:
        (self._kernels, self._ffi), self._precision = code, precision
        self._size, self._rows, self._upper = size, (len(rows.pointer) - 1) // size, upper
        self._columns = self._rows if upper else _whole(int(rows.columns.max(initial=-1)) + 1, size)
        places: Longs = np.zeros(max(self._rows, self._columns), dtype=np.int64)
        first: Longs = np.zeros(self._rows + 1, dtype=np.int64)
        self._places, self._first = self._of("int64_t[]", places), self._of("int64_t[]", first)
        self._kernels.count(*self._told(rows), self._places, self._first)
        places[:] = 0
        blocks: Ints = np.zeros(int(first[-1]), dtype=np.int32)
        self._blocks = self._of("int32_t[]", blocks)
        self._kernels.pattern(*self._told(rows), self._places, self._first, self._blocks)
        width = 4 if size <= 4 else 8
        self._kept = self._reals(len(blocks) * size**2 + width)  # as loads reach beyond the last
        self._x, self._y = self._reals(width * self._columns), self._reals(width * self._rows)

    def fill(self, rows: Rows) -> None:
        """Take entries."""
        values = self._of("double[]", rows.values)
        self._kernels.fill(
            *self._told(rows), values, self._places, self._first, self._blocks, self._kept
        )

    def take(self, x: Floats) -> None:
        """Take what is multiplied."""
        self._kernels.take(self._size, self._columns, self._of("double[]", x), self._x)

    def product(self) -> None:
        """Multiply, with the blocks' transposes too."""
        self._kernels.product(*self._matrix, self._x, self._y)

    def add_to(self, other: "_Blocks") -> None:
        """Add a product to another one."""
        self._kernels.add(*self._matrix, self._x, other._y)

    def give(self, y: Floats) -> None:
        """Give the product."""
        self._kernels.give(self._size, self._rows, self._y, self._of("double[]", y))

    @property
    def _matrix(self) -> tuple[Any, ...]:
        return self._size, self._rows, self._first, self._blocks, self._kept

    def _told(self, rows: Rows) -> tuple[Any, ...]:
        """What kernels are told of rows."""
        of = f"int{8 * rows.pointer.itemsize}_t[]"
        arrays = (self._of(of, array) for array in (rows.pointer, rows.columns))
        return self._size, self._rows, int(self._upper), *arrays

    def _reals(self, count: int) -> Any:
        kind = "float[]" if self._precision is np.float32 else "double[]"
        return self._of(kind, np.zeros(count, dtype=self._precision))

    def _of(self, kind: str, array: npt.NDArray) -> Any:
        """An array as kernels take it, which keeps it alive."""
        return self._ffi.from_buffer(kind, array)


def ghosts_of(A: PETSc.Mat, columns: npt.NDArray[np.integer]) -> tuple[PETSc.Vec, PETSc.Scatter]:
    """Room for what other ranks have of a vector, and what brings it. Collective.

    Args:
        A: Which multiplies the vector.
        columns: Global numbers of columns of A that are of other ranks.

    Returns:
        Room for whole blocks of columns; what brings them there.
    """
    size = A.getBlockSizes()[1]
    ghosts = PETSc.Vec().createSeq(size * _whole(len(columns), size), comm=PETSc.COMM_SELF)
    if A.comm.getSize() == 1:
        return ghosts, PETSc.Scatter()
    x = A.createVecRight()
    chosen = PETSc.IS().createGeneral(columns.astype(PETSc.IntType), comm=PETSc.COMM_SELF)
    places = PETSc.IS().createStride(len(columns), step=1, comm=PETSc.COMM_SELF)
    scatter = PETSc.Scatter().create(x, chosen, ghosts, places)
    for thing in (x, chosen, places):
        thing.destroy()
    return ghosts, scatter


def _whole(entries: int, size: int) -> int:
    """How many blocks it takes for so many entries."""
    return -(-entries // size)
