"""Multiply by a symmetric matrix, with the blocks of its upper triangle, in C.

Memory traffic limits the speed of products. Storing only the upper triangle halves this traffic;
single precision reduces it to a quarter. The smoothers of multigrid, which multiply six times for
each product in CG, use single precision. The relative change of the preconditioner is about 1e-7.
CG itself, coarse spaces and factors use double precision.

This module also generates the C source of the products, in either precision. Vectors are padded to
the vector width. Entries that are loaded beyond a row are multiplied by zeros or stored in the
padding. A symmetric matrix is stored as the blocks of its upper triangle, with the diagonal block
first in each row.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats, Ints, Longs
from perfplast_fenicsx.compiled_kernels import compiled
from perfplast_fenicsx.solvers.linear.petsc_calls import Rows, own_rows


def sizes() -> tuple[int, ...]:
    """Return the supported block sizes: unknowns per node, and motions per aggregate."""
    return 2, 3, 4, 6, 7


def for_size(of: str) -> str:
    """Return a C macro that calls a function with a variable size as a compile-time constant.

    Args:
        of: Name of the variable with the size.
    """
    cases = (f"case {size}: function({size}, __VA_ARGS__); break;" for size in sizes())
    return f"#define FOR_SIZE(function, ...) switch ({of}) {{ {' '.join(cases)} }}\n"


def own_types(text: str, precision: type[np.floating]) -> str:
    """Return C source with PETSc's integer type for INDEX and the stored precision for REAL."""
    whole = f"int{8 * np.dtype(PETSc.IntType).itemsize}_t"
    real = {np.float32: "float", np.float64: "double"}[precision]
    head = r"""
#include <stdint.h>
#include <string.h>

#define OWN static inline __attribute__((always_inline))
"""
    return head + text.replace("INDEX", whole).replace("REAL", real)


def rows_source(precision: type[np.floating]) -> str:
    """Return the C source of ``pattern`` and ``fill`` for blocks with n rows and m columns.

    Args:
        precision: Precision of the stored values, float32 or float64.
    """
    return own_types(_kernels() + for_size("n") + _row_calls(), precision)


def _kernels() -> str:
    return r"""
/* Write the index of the first block in each block row to first. If the number of blocks is known,
   write their block columns to block. For a symmetric matrix these are the blocks of the upper
   triangle, with the diagonal block first. */
OWN void pattern_(const int n, const int m, int64_t rows, int upper, const INDEX *start,
                  const INDEX *column, int64_t *mark, int64_t *first, int known, int32_t *block) {
  int64_t count = 0;
  for (int64_t r = 0; r < rows; ++r) {
    first[r] = count;
    if (upper) {
      mark[r] = r + 1;
      if (known) block[count] = (int32_t)r;
      ++count;
    }
    for (int64_t e = start[n * r]; e < start[n * r + n]; ++e) {
      int64_t c = column[e] / m;
      if ((upper && c < r) || mark[c] == r + 1) continue;
      mark[c] = r + 1;
      if (known) block[count] = (int32_t)c;
      ++count;
    }
  }
  first[rows] = count;
}

/* return the number of entries without a block */
OWN int64_t fill_(const int n, const int m, int64_t rows, int64_t columns, int upper,
                  const INDEX *start, const INDEX *column, const double *value, int64_t *place,
                  const int64_t *first, const int32_t *block, REAL *kept) {
  int64_t astray = 0;
  memset(kept, 0, sizeof(REAL) * n * m * (size_t)first[rows]);
  for (int64_t c = 0; c < columns; ++c) place[c] = -1;
  for (int64_t r = 0; r < rows; ++r) {
    for (int64_t b = first[r]; b < first[r + 1]; ++b) place[block[b]] = b;
    for (int i = 0; i < n; ++i)
      for (int64_t e = start[n * r + i]; e < start[n * r + i + 1]; ++e) {
        int64_t c = column[e] / m;
        if (upper && c < r) continue;
        int64_t b = c < columns ? place[c] : -1;
        if (b < first[r]) ++astray;  /* only an earlier row, or no row, has a block there */
        else kept[n * m * b + m * i + column[e] - m * c] = (REAL)value[e];
      }
  }
  return astray;
}

#define SQUARE(n, ...) found = fill_(n, n, __VA_ARGS__)
"""


def _row_calls() -> str:
    return r"""
void pattern(int n, int m, int64_t rows, int64_t columns, int upper, const INDEX *start,
             const INDEX *column, int64_t *mark, int64_t *first, int known, int32_t *block) {
  pattern_(n, m, rows, upper, start, column, mark, first, known, block);
}

int64_t fill(int n, int m, int64_t rows, int64_t columns, int upper, const INDEX *start,
             const INDEX *column, const double *value, int64_t *place, const int64_t *first,
             const int32_t *block, REAL *kept) {
  int64_t found = -1;
  if (n == m) {
    FOR_SIZE(SQUARE, rows, columns, upper, start, column, value, place, first, block, kept)
  } else {
    found = fill_(n, m, rows, columns, upper, start, column, value, place, first, block, kept);
  }
  return found;
}
"""


class BlockRows:
    """A copy of blocks for the kernels, row by row, in a given precision.

    Attributes:
        rows: Number of block rows; ``columns`` is the number of block columns.
        matrix: Data for the kernels: the start of each row, the columns of the blocks, and the
            entries of the blocks, row by row.
    """

    def __init__(
        self,
        comm: MPI.Intracomm,
        precision: type[np.floating],
        both: tuple[int, int],
        rows: Rows,
        columns: int,
        *,
        upper: bool = False,
    ) -> None:
        """Find the pattern of the blocks. Collective.

        Args:
            comm: Communicator of the matrix.
            precision: Precision of the stored entries, float32 or float64.
            both: Numbers of rows and columns in a block, each a supported size.
            rows: Rows of this rank.
            columns: Number of columns, which the class rounds up to whole blocks.
            upper: Whether the matrix is symmetric. If so, only the blocks of its upper triangle are
                stored, with the diagonal block first in each row.
        """
        assert set(both) <= set(sizes()), f"no kernel for blocks of {both}"
        self._kernels, self._ffi = compiled(comm, rows_source(precision))
        self._both, self._upper, self._precision = both, upper, precision
        self.rows, self.columns = whole(len(rows.pointer) - 1, both[0]), whole(columns, both[1])
        places: Longs = np.zeros(self.columns, dtype=np.int64)
        first: Longs = np.zeros(self.rows + 1, dtype=np.int64)
        self._places, begin = self._of("int64_t[]", places), self._of("int64_t[]", first)
        none = self._of("int32_t[]", np.zeros(0, dtype=np.int32))
        self._kernels.pattern(*self._told(rows), self._places, begin, 0, none)
        places[:] = 0
        blocks: Ints = np.zeros(int(first[-1]), dtype=np.int32)
        found = self._of("int32_t[]", blocks)
        self._kernels.pattern(*self._told(rows), self._places, begin, 1, found)
        kept = self.reals(
            len(blocks) * both[0] * both[1] + room_of(both[1])
        )  # padding for the last load
        self.matrix = begin, found, kept

    def fill(self, rows: Rows) -> None:
        """Set the entries, which must lie within the pattern of the first rows."""
        values = self._of("double[]", rows.values)
        astray = self._kernels.fill(*self._told(rows), values, self._places, *self.matrix)
        assert astray == 0, f"{astray} entries are outside the first pattern of the matrix"

    def _of(self, kind: str, array: npt.NDArray) -> Any:
        """Return an array as a kernel argument, which keeps the array alive."""
        return self._ffi.from_buffer(kind, array)

    def reals(self, count: int) -> Any:
        """Return a zero array in the stored precision as a kernel argument."""
        kind = "float[]" if self._precision is np.float32 else "double[]"
        return self._of(kind, np.zeros(count, dtype=self._precision))

    def vector(self, array: Floats) -> Any:
        """Return double-precision numbers as a kernel argument."""
        return self._of("double[]", array)

    def _told(self, rows: Rows) -> tuple[Any, ...]:
        """Return the kernel arguments that describe the rows."""
        of = f"int{8 * rows.pointer.itemsize}_t[]"
        arrays = (self._of(of, array) for array in (rows.pointer, rows.columns))
        return *self._both, self.rows, self.columns, int(self._upper), *arrays


def whole(entries: int, size: int) -> int:
    """Return the number of blocks for a number of entries."""
    return -(-entries // size)


def room_of(size: int) -> int:
    """Return the padded length of a block in a vector: a multiple of the vector width."""
    few, many = 4, 8
    return few if size <= few else many


def products_source(precision: type[np.floating]) -> str:
    """Return the C source of the functions ``product``, ``add``, ``take`` and ``give``.

    Args:
        precision: Precision of storage and products, float32 or float64.
    """
    products = "".join(
        _products().replace("_WIDTH", f"_{width}").replace("LANES", f"{width}") for width in (4, 8)
    )
    return own_types(products + for_size("n") + _product_calls(), precision)


def _products() -> str:
    return r"""
typedef REAL lanes_WIDTH __attribute__((vector_size(sizeof(REAL) * LANES)));

OWN void rows_WIDTH(const int n, const REAL *A, const REAL *z, lanes_WIDTH *sum) {
  lanes_WIDTH row, given;
  memcpy(&given, z, sizeof given);
  for (int i = 0; i < n; ++i) {
    memcpy(&row, A + n * i, sizeof row);
    sum[i] += row * given;
  }
}

OWN void both_WIDTH(const int n, const REAL *A, const REAL *z, const REAL *own,
                     lanes_WIDTH *sum, REAL *other) {
  lanes_WIDTH row, given, taken;
  memcpy(&given, z, sizeof given);
  memcpy(&taken, other, sizeof taken);
  for (int i = 0; i < n; ++i) {
    memcpy(&row, A + n * i, sizeof row);
    sum[i] += row * given;
    taken += row * own[i];
  }
  memcpy(other, &taken, sizeof taken);
}

OWN void put_WIDTH(const int n, const lanes_WIDTH *sum, REAL *y) {
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) y[i] += sum[i][j];
}

OWN void product_WIDTH(const int n, int64_t rows, const int64_t *first,
                        const int32_t *block, const REAL *kept, const REAL *x, REAL *y) {
  for (int64_t r = 0; r < rows; ++r) {
    lanes_WIDTH sum[8] = {0};
    REAL own[8];
    for (int i = 0; i < n; ++i) own[i] = x[LANES * r + i];
    const REAL *A = kept + n * n * first[r];
    rows_WIDTH(n, A, x + LANES * r, sum);
    for (int64_t b = first[r] + 1; b < first[r + 1]; ++b) {
      A += n * n;
      both_WIDTH(n, A, x + LANES * (int64_t)block[b], own, sum,
                  y + LANES * (int64_t)block[b]);
    }
    put_WIDTH(n, sum, y + LANES * r);
  }
}

OWN void add_WIDTH(const int n, int64_t rows, const int64_t *first, const int32_t *block,
                    const REAL *kept, const REAL *x, REAL *y) {
  for (int64_t r = 0; r < rows; ++r) {
    lanes_WIDTH sum[8] = {0};
    for (int64_t b = first[r]; b < first[r + 1]; ++b)
      rows_WIDTH(n, kept + n * n * b, x + LANES * (int64_t)block[b], sum);
    put_WIDTH(n, sum, y + LANES * r);
  }
}
"""


def _product_calls() -> str:
    return r"""
/* stored length of a vector with n entries; stored values after these are zero or unused */
#define WIDTH(n) ((n) > 4 ? 8 : 4)

OWN void product_(const int n, int64_t rows, const int64_t *first, const int32_t *block,
                  const REAL *kept, const REAL *x, REAL *y) {
  memset(y, 0, sizeof(REAL) * WIDTH(n) * (size_t)rows);
  if (WIDTH(n) == 4) product_4(n, rows, first, block, kept, x, y);
  else product_8(n, rows, first, block, kept, x, y);
}

OWN void add_(const int n, int64_t rows, const int64_t *first, const int32_t *block,
              const REAL *kept, const REAL *x, REAL *y) {
  if (WIDTH(n) == 4) add_4(n, rows, first, block, kept, x, y);
  else add_8(n, rows, first, block, kept, x, y);
}

OWN void take_(const int n, int64_t rows, const double *given, REAL *x) {
  for (int64_t r = 0; r < rows; ++r)
    for (int i = 0; i < n; ++i) x[WIDTH(n) * r + i] = (REAL)given[n * r + i];
}

OWN void give_(const int n, int64_t rows, const REAL *y, double *taken) {
  for (int64_t r = 0; r < rows; ++r)
    for (int i = 0; i < n; ++i) taken[n * r + i] = y[WIDTH(n) * r + i];
}

void product(int n, int64_t rows, const int64_t *first, const int32_t *block, const REAL *kept,
             const REAL *x, REAL *y) {
  FOR_SIZE(product_, rows, first, block, kept, x, y)
}

void add(int n, int64_t rows, const int64_t *first, const int32_t *block, const REAL *kept,
         const REAL *x, REAL *y) {
  FOR_SIZE(add_, rows, first, block, kept, x, y)
}

void take(int n, int64_t rows, const double *given, REAL *x) {
  FOR_SIZE(take_, rows, given, x)
}

void give(int n, int64_t rows, const REAL *y, double *taken) {
  FOR_SIZE(give_, rows, y, taken)
}
"""


class BlockedProducts:
    """Products with a symmetric matrix that is stored as the blocks of its upper triangle.

    Attributes:
        matrix: PETSc matrix of type "python" that computes the products.
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
        kernels, of = compiled(comm, products_source(precision))[0], (comm, precision, (size, size))
        own = BlockRows(*of, here, A.getLocalSize()[1], upper=True)
        self._here, self._there = _Products(kernels, own, size), None
        if there is not None:
            others = BlockRows(*of, there, self._ghosts.getLocalSize())
            self._there = _Products(kernels, others, size)
        self.matrix = PETSc.Mat().createPython(A.getSizes(), _Called(self.product), comm=A.comm)
        self.matrix.setBlockSize(size)
        self.matrix.setUp()

    def fill(self, A: PETSc.Mat) -> None:
        """Copy the entries of a matrix with the same pattern as the first matrix. Collective."""
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
        """Release the memory of PETSc objects. Collective."""
        for thing in (self.matrix, self._ghosts, self._scatter):
            thing.destroy()


@dataclass(frozen=True)
class _Called:
    """The callback of the PETSc matrix, which multiplies a vector."""

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
        """Set the entries of the blocks."""
        self._of.fill(rows)

    def take(self, x: Floats) -> None:
        """Copy the vector by which the matrix is multiplied."""
        self._kernels.take(self._size, self._of.columns, self._of.vector(x), self._x)

    def product(self) -> None:
        """Multiply by the blocks and by their transposes."""
        self._kernels.product(self._size, self._of.rows, *self._of.matrix, self._x, self._y)

    def add_to(self, other: "_Products") -> None:
        """Add the product to the result of ``other``."""
        self._kernels.add(self._size, self._of.rows, *self._of.matrix, self._x, other._y)

    def give(self, y: Floats) -> None:
        """Copy the product to a vector."""
        self._kernels.give(self._size, self._of.rows, self._y, self._of.vector(y))


def ghosts_of(A: PETSc.Mat, columns: npt.NDArray[np.integer]) -> tuple[PETSc.Vec, PETSc.Scatter]:
    """Return a vector for entries of other ranks, and the scatter that fills it. Collective.

    Args:
        A: Matrix that multiplies the vector.
        columns: Global numbers of the columns of A on other ranks.

    Returns:
        A vector for whole blocks of columns; and the scatter.
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
