"""Interpolations between levels of multigrid in single precision, by blocks of nodes, in C."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.arrays import Floats, Ints, Longs
from perfplast_fenicsx.compiled_kernels import compiled
from perfplast_fenicsx.solvers.linear.blocked_products import ghosts_of
from perfplast_fenicsx.solvers.linear.blocked_source import sizes
from perfplast_fenicsx.solvers.linear.csr_arrays import Rows, own_rows
from perfplast_fenicsx.solvers.linear.interpolation_source import source


class BlockedInterpolation:
    """P x, and Pᵀ x.

    Attributes:
        matrix: PETSc's object that multiplies.
    """

    def __init__(self, P: PETSc.Mat) -> None:
        """Make room. Collective.

        Args:
            P: Of type "aij", with blocks of sizes that kernels have.
        """
        both = P.getBlockSizes()
        assert set(both) <= set(sizes()), f"no kernel for blocks of {both}"
        code = compiled(P.comm.tompi4py(), source())
        here, there, columns = own_rows(P)
        coarse = P.getLocalSize()[1]
        self._here = _Blocks(*code, both, here, coarse)
        self._ghosts, self._scatter = ghosts_of(P, columns)
        self._there = None
        if there is not None:
            self._there = _Blocks(*code, both, there, self._ghosts.getLocalSize())
        called = _Called(self.interpolate, self.restrict)
        self.matrix = PETSc.Mat().createPython(P.getSizes(), called, comm=P.comm)
        self.matrix.setUp()

    def fill(self, P: PETSc.Mat) -> None:
        """Take the entries of a matrix with the pattern of the first one. Collective."""
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
        """Give PETSc's memory back. Collective."""
        for thing in (self.matrix, self._ghosts, self._scatter):
            thing.destroy()


@dataclass(frozen=True)
class _Called:
    """What PETSc calls."""

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


class _Blocks:
    """Blocks of compressed rows, and room for what they are multiplied with."""

    def __init__(
        self, kernels: Any, ffi: Any, sizes: tuple[int, int], rows: Rows, columns: int
    ) -> None:
        self._kernels, self._ffi, self._sizes = kernels, ffi, sizes
        fine, coarse = sizes
        self._rows, self._columns = (len(rows.pointer) - 1) // fine, -(-columns // coarse)
        places: Longs = np.zeros(self._columns, dtype=np.int64)
        first: Longs = np.zeros(self._rows + 1, dtype=np.int64)
        self._places, self._first = self._of("int64_t[]", places), self._of("int64_t[]", first)
        none = self._of("int32_t[]", np.zeros(0, dtype=np.int32))
        kernels.pattern(*self._told(rows), self._places, self._first, 0, none)
        places[:] = 0
        blocks: Ints = np.zeros(int(first[-1]), dtype=np.int32)
        self._blocks = self._of("int32_t[]", blocks)
        kernels.pattern(*self._told(rows), self._places, self._first, 1, self._blocks)
        width = 4 if coarse <= 4 else 8
        reals = (len(blocks) * fine * coarse + width, width * self._columns)
        arrays = (np.zeros(count, dtype=np.float32) for count in reals)
        self._kept, self._x = (self._of("float[]", array) for array in arrays)

    def fill(self, rows: Rows) -> None:
        """Take entries."""
        values = self._of("double[]", rows.values)
        room = self._first, self._blocks, self._kept
        self._kernels.fill(*self._told(rows), values, self._places, *room)

    def interpolate(self, x: Floats, y: Floats) -> None:
        """Add P x to y."""
        self._call("interpolate", x, y)

    def restrict(self, x: Floats, y: Floats) -> None:
        """Set y to Pᵀ x."""
        self._call("restrict_", x, y)

    def _call(self, name: str, x: Floats, y: Floats) -> None:
        sizes = *self._sizes, self._rows, self._columns
        matrix = self._first, self._blocks, self._kept
        vectors = (self._of("double[]", array) for array in (x, y))
        getattr(self._kernels, name)(*sizes, *matrix, self._x, *vectors)

    def _told(self, rows: Rows) -> tuple[Any, ...]:
        """What kernels are told of rows."""
        of = f"int{8 * rows.pointer.itemsize}_t[]"
        return *self._sizes, self._rows, self._of(of, rows.pointer), self._of(of, rows.columns)

    def _of(self, kind: str, array: np.ndarray) -> Any:
        """An array as kernels take it, which keeps it alive."""
        return self._ffi.from_buffer(kind, array)
