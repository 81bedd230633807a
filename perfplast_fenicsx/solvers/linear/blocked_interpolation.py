"""Interpolate between levels of multigrid in single precision, by blocks of nodes, in C."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.compiled_kernels import compiled
from perfplast_fenicsx.solvers.linear.block_rows import BlockRows, room_of
from perfplast_fenicsx.solvers.linear.blocked_products import ghosts_of
from perfplast_fenicsx.solvers.linear.csr_arrays import Rows, own_rows
from perfplast_fenicsx.solvers.linear.interpolation_source import source


class BlockedInterpolation:
    """Products P x and Pᵀ x.

    Attributes:
        matrix: PETSc's matrix that multiplies.
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
        """Copy the entries of a matrix with the pattern of the first one. Collective."""
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
        """Release PETSc's memory. Collective."""
        for thing in (self.matrix, self._ghosts, self._scatter):
            thing.destroy()


@dataclass(frozen=True)
class _Called:
    """The functions that PETSc calls."""

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
        """Set the entries."""
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
