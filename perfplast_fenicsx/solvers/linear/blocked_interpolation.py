"""Interpolate between multigrid levels in single precision, by blocks of nodes, in C.

Coarse vectors are padded to the vector width. Entries that are loaded beyond a row are multiplied
by zeros or stored in the padding.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.compiled_kernels import compiled
from perfplast_fenicsx.solvers.linear.blocked_products import (
    BlockRows,
    for_size,
    ghosts_of,
    own_types,
    room_of,
)
from perfplast_fenicsx.solvers.linear.petsc_calls import Rows, own_rows


def source() -> str:
    """Return the C source of the functions ``interpolate`` and ``restrict_``."""
    products = "".join(
        _products().replace("_WIDTH", f"_{width}").replace("LANES", f"{width}") for width in (4, 8)
    )
    return own_types(products + for_size("fine") + _calls(), np.float32)


def _products() -> str:
    return r"""
typedef float lanes_WIDTH __attribute__((vector_size(4 * LANES)));

OWN void interpolate_WIDTH(const int fine, int coarse, int64_t rows, const int64_t *first,
                           const int32_t *block, const float *kept, const float *x, double *y) {
  for (int64_t r = 0; r < rows; ++r) {
    lanes_WIDTH sum[8] = {0}, row, given;
    for (int64_t b = first[r]; b < first[r + 1]; ++b) {
      const float *A = kept + fine * coarse * b;
      memcpy(&given, x + LANES * (int64_t)block[b], sizeof given);
      for (int i = 0; i < fine; ++i) {
        memcpy(&row, A + coarse * i, sizeof row);
        sum[i] += row * given;
      }
    }
    for (int i = 0; i < fine; ++i) {
      float all = 0;
      for (int j = 0; j < coarse; ++j) all += sum[i][j];
      y[fine * r + i] += all;
    }
  }
}

OWN void restrict_WIDTH(const int fine, int coarse, int64_t rows, const int64_t *first,
                        const int32_t *block, const float *kept, const double *x, float *y) {
  for (int64_t r = 0; r < rows; ++r) {
    float own[8];
    for (int i = 0; i < fine; ++i) own[i] = (float)x[fine * r + i];
    for (int64_t b = first[r]; b < first[r + 1]; ++b) {
      const float *A = kept + fine * coarse * b;
      lanes_WIDTH row, taken;
      memcpy(&taken, y + LANES * (int64_t)block[b], sizeof taken);
      for (int i = 0; i < fine; ++i) {
        memcpy(&row, A + coarse * i, sizeof row);
        taken += row * own[i];
      }
      memcpy(y + LANES * (int64_t)block[b], &taken, sizeof taken);
    }
  }
}
"""


def _calls() -> str:
    return r"""
void interpolate(int fine, int coarse, int64_t rows, int64_t columns, const int64_t *first,
                 const int32_t *block, const float *kept, float *room, const double *x,
                 double *y) {
  const int width = coarse > 4 ? 8 : 4;
  for (int64_t c = 0; c < columns; ++c)
    for (int i = 0; i < width; ++i) room[width * c + i] = i < coarse ? (float)x[coarse * c + i] : 0;
  if (width == 4) {
    FOR_SIZE(interpolate_4, coarse, rows, first, block, kept, room, y)
  } else {
    FOR_SIZE(interpolate_8, coarse, rows, first, block, kept, room, y)
  }
}

void restrict_(int fine, int coarse, int64_t rows, int64_t columns, const int64_t *first,
               const int32_t *block, const float *kept, float *room, const double *x, double *y) {
  const int width = coarse > 4 ? 8 : 4;
  memset(room, 0, sizeof(float) * width * (size_t)columns);
  if (width == 4) {
    FOR_SIZE(restrict_4, coarse, rows, first, block, kept, x, room)
  } else {
    FOR_SIZE(restrict_8, coarse, rows, first, block, kept, x, room)
  }
  for (int64_t c = 0; c < columns; ++c)
    for (int i = 0; i < coarse; ++i) y[coarse * c + i] = room[width * c + i];
}
"""


class BlockedInterpolation:
    """Products P x and Pᵀ x with an interpolation P.

    Attributes:
        matrix: PETSc matrix of type "python" that computes the products.
    """

    def __init__(self, P: PETSc.Mat) -> None:
        """Allocate memory. Collective.

        Args:
            P: Interpolation of type "aij", with blocks of supported sizes.
        """
        both = P.getBlockSizes()
        comm = P.comm.tompi4py()
        kernels, of = compiled(comm, source())[0], (comm, np.float32, both)
        here, there, columns = own_rows(P)
        self._ghosts, self._scatter = ghosts_of(P, columns)
        own = BlockRows(*of, here, P.getLocalSize()[1])
        self._here, self._there = _Interpolation(kernels, own, both), None
        if there is not None:
            others = BlockRows(*of, there, self._ghosts.getLocalSize())
            self._there = _Interpolation(kernels, others, both)
        called = _Called(self.interpolate, self.restrict)
        self.matrix = PETSc.Mat().createPython(P.getSizes(), called, comm=P.comm)
        self.matrix.setUp()

    def fill(self, P: PETSc.Mat) -> None:
        """Copy the entries of a matrix with the same pattern as the first matrix. Collective."""
        here, there, _ = own_rows(P)
        self._here.fill(here)
        if self._there is not None and there is not None:
            self._there.fill(there)

    def interpolate(self, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Add P x to y. Collective."""
        if self._there is not None:
            self._scatter.begin(x, self._ghosts)
        array = y.array
        self._here.interpolate(x.array_r, array)
        if self._there is not None:
            self._scatter.end(x, self._ghosts)
            self._there.interpolate(self._ghosts.array_r, array)

    def restrict(self, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Set y to Pᵀ x. Collective."""
        self._here.restrict(x.array_r, y.array)
        if self._there is None:
            return
        self._there.restrict(x.array_r, self._ghosts.array)
        add, back = PETSc.InsertMode.ADD, PETSc.ScatterMode.REVERSE
        self._scatter.scatter(self._ghosts, y, addv=add, mode=back)

    def destroy(self) -> None:
        """Release the memory of PETSc objects. Collective."""
        for thing in (self.matrix, self._ghosts, self._scatter):
            thing.destroy()


@dataclass(frozen=True)
class _Called:
    """The callbacks of the PETSc matrix, which apply the interpolation."""

    interpolate: Callable[[PETSc.Vec, PETSc.Vec], None]
    restrict: Callable[[PETSc.Vec, PETSc.Vec], None]

    def mult(self, matrix: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Set y to P x."""
        y.set(0.0)
        self.interpolate(x, y)

    def multAdd(self, matrix: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec, z: PETSc.Vec) -> None:
        """Set z to y + P x."""
        if z.handle != y.handle:
            y.copy(z)
        self.interpolate(x, z)

    def multTranspose(self, matrix: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Set y to Pᵀ x."""
        self.restrict(x, y)


class _Interpolation:
    """Products with blocks of rows, and with their transposes."""

    def __init__(self, kernels: Any, of: BlockRows, both: tuple[int, int]) -> None:
        self._kernels, self._of, self._both = kernels, of, both
        self._room = of.reals(room_of(both[1]) * of.columns)

    def fill(self, rows: Rows) -> None:
        """Set the entries of the blocks."""
        self._of.fill(rows)

    def interpolate(self, x: Floats, y: Floats) -> None:
        """Add P x to y."""
        self._call("interpolate", x, y)

    def restrict(self, x: Floats, y: Floats) -> None:
        """Set y to Pᵀ x."""
        self._call("restrict_", x, y)

    def _call(self, name: str, x: Floats, y: Floats) -> None:
        of = self._of
        sizes, vectors = (*self._both, of.rows, of.columns), (of.vector(x), of.vector(y))
        getattr(self._kernels, name)(*sizes, *of.matrix, self._room, *vectors)
