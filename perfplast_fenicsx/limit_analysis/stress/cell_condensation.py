"""Eliminate inner unknowns of all cells of a rank by Cholesky factors of compiled kernels."""

from typing import Any

from mpi4py import MPI

import numpy as np

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.compiled_kernels import aligned, compiled
from perfplast_fenicsx.limit_analysis.stress.condensation_source import source


class CellCondensation:
    """Factors L of the inner block of each cell's K, and L⁻¹ times its coupling block."""

    def __init__(self, comm: MPI.Intracomm, rows: Longs, matrices: Floats, outer: int) -> None:
        """Compile the kernels, and allocate arrays. Collective.

        Args:
            comm: The ranks.
            rows: Unknown of a cell for each row at each point, shape (num_points, n). Outer
                unknowns come first, and each inner unknown has a row.
            matrices: Matrices of the points, shape (num_cells, num_points, n, 1 + m).
            outer: Number of unknowns that are kept.
        """
        self._rows = np.ascontiguousarray(rows, dtype=np.int64)
        self._matrices = np.ascontiguousarray(matrices)
        self._outer, self._inner = outer, int(rows.max()) + 1 - outer
        self._count, self._points, self._height, self._parts = matrices.shape
        self._kernels, self._ffi = compiled(comm, source())
        at_once = 4  # cells that the kernels work on
        padded = -(-self._count // at_once) * at_once
        inner = self._inner
        self._factors = aligned(padded * (inner * (inner + 1) // 2 + outer * inner))
        self._half = aligned(padded * inner)

    def condense(self, roots: Floats, more: Floats, ridge: Floats) -> tuple[Floats, bool]:
        """Eliminate the inner unknowns from Σ (Bᵀ R)(Bᵀ R)ᵀ.

        Args:
            roots: Roots R of the moduli times weights, shape (num_cells, num_points, 1 + m, 1 + m).
            more: Additional diagonal of the inner unknowns, shape (num_cells, inner).
            ridge: Share by which the diagonal of the outer unknowns increases, shape (num_cells,).

        Returns:
            The remaining matrix of the outer unknowns, shape (num_cells, outer, outer); whether the
            elimination has succeeded.
        """
        left = np.empty((self._count, self._outer, self._outer))
        failed = self._kernels.condense(
            self._count,
            self._points,
            self._height,
            self._parts,
            *self._sizes,
            self._ffi.from_buffer("int64_t[]", self._rows),
            self._given(self._matrices),
            *(self._given(array) for array in (roots, more, ridge)),
            *(self._taken(array) for array in (self._factors, left)),
        )
        return left, failed == 0

    def push_out(self, forces: Floats) -> Floats:
        """Return forces on inner unknowns as forces on the outer ones, shape (num_cells, outer).

        Args:
            forces: Forces, shape (num_cells, inner); the next :meth:`bring_in` uses the same ones.
        """
        onto = np.empty((self._count, self._outer))
        self._kernels.push_out(
            self._count,
            *self._sizes,
            self._given(self._factors),
            self._given(forces),
            *(self._taken(array) for array in (self._half, onto)),
        )
        return onto

    def bring_in(self, outer: Floats) -> Floats:
        """Return inner unknowns for outer ones and the last forces, shape (num_cells, inner).

        Args:
            outer: Outer unknowns, shape (num_cells, outer).
        """
        found = np.empty((self._count, self._inner))
        self._kernels.bring_in(
            self._count,
            *self._sizes,
            self._given(self._factors),
            self._taken(self._half),
            self._given(outer),
            self._taken(found),
        )
        return found

    @property
    def _sizes(self) -> tuple[int, int]:
        return self._outer, self._inner

    def _given(self, array: Floats) -> Any:
        return self._ffi.from_buffer("double[]", np.ascontiguousarray(array, dtype=np.float64))

    def _taken(self, array: Floats) -> Any:
        return self._ffi.from_buffer("double[]", array, require_writable=True)
