"""Store blocks of the compressed rows of a matrix, for kernels in C."""

from typing import Any

from mpi4py import MPI

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats, Ints, Longs
from perfplast_fenicsx.compiled_kernels import compiled
from perfplast_fenicsx.solvers.linear.block_rows_source import sizes, source
from perfplast_fenicsx.solvers.linear.csr_arrays import Rows


class BlockRows:
    """Blocks row by row, with their own order and precision.

    Attributes:
        rows: Number of block rows; ``columns`` is that of block columns.
        matrix: Data for kernels: beginnings of the rows, columns of the blocks, and their entries,
            row by row.
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
        """Find the blocks. Collective.

        Args:
            comm: Communicator of the matrix.
            precision: Precision of the stored entries, float32 or float64.
            both: Rows and columns of a block, each of a supported size.
            rows: This rank's rows.
            columns: Least number of columns.
            upper: Whether the matrix is symmetric, and only blocks of its upper triangle are
                stored, with the diagonal block first in each row.
        """
        assert set(both) <= set(sizes()), f"no kernel for blocks of {both}"
        self._kernels, self._ffi = compiled(comm, source(precision))
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
        """Set the entries, within the pattern of the first rows."""
        values = self._of("double[]", rows.values)
        astray = self._kernels.fill(*self._told(rows), values, self._places, *self.matrix)
        assert astray == 0, f"{astray} entries are outside the first pattern of the matrix"

    def _of(self, kind: str, array: npt.NDArray) -> Any:
        """Return an array as a kernel argument, which keeps it alive."""
        return self._ffi.from_buffer(kind, array)

    def reals(self, count: int) -> Any:
        """Return an array for numbers of the precision."""
        kind = "float[]" if self._precision is np.float32 else "double[]"
        return self._of(kind, np.zeros(count, dtype=self._precision))

    def vector(self, array: Floats) -> Any:
        """Return double-precision numbers as a kernel argument."""
        return self._of("double[]", array)

    def _told(self, rows: Rows) -> tuple[Any, ...]:
        """Return the kernel arguments for rows."""
        of = f"int{8 * rows.pointer.itemsize}_t[]"
        arrays = (self._of(of, array) for array in (rows.pointer, rows.columns))
        return *self._both, self.rows, self.columns, int(self._upper), *arrays


def whole(entries: int, size: int) -> int:
    """Return the number of blocks for a number of entries."""
    return -(-entries // size)


def room_of(size: int) -> int:
    """Return the padded length of a block in a vector, a multiple of the vector width."""
    few, many = 4, 8
    return few if size <= few else many
