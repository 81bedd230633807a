"""Inner unknowns of all cells of a rank, eliminated by Cholesky factors of compiled kernels."""

from typing import Any

from mpi4py import MPI

import numpy as np

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.compiled_kernels import aligned, compiled
from perfplast_fenicsx.limit_analysis.stress.condensation_source import source


class CellCondensation:
    """Factors L of what a cell's inner unknowns have of K, and L⁻¹ times what couples them."""

    def __init__(self, comm: MPI.Intracomm, rows: Longs, matrices: Floats, outer: int) -> None:
        """Compile the kernels, and make room. Collective.

        Args:
            comm: The ranks.
            rows: Unknown of a cell, the outer ones first, of each row at each point, shape
                (num_points, n); all inner ones have some.
            matrices: Matrices of the points, shape (num_cells, num_points, n, 1 + m).
            outer: Unknowns that are kept.
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
        """Eliminate from Σ (Bᵀ R)(Bᵀ R)ᵀ.

        Args:
            roots: R of the moduli times weights, shape (num_cells, num_points, 1 + m, 1 + m).
            more: On the diagonal of the inner unknowns, shape (num_cells, inner).
            ridge: Share of the diagonal of the outer ones that they get besides, shape
                (num_cells,).

        Returns:
            What is left on the outer unknowns, shape (num_cells, outer, outer); whether it could be
            done.
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
            forces: Shape (num_cells, inner); :meth:`bring_in` has to do with the same ones.
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
        """The inner unknowns, shape (num_cells, inner), from the outer ones, and the last forces.

        Args:
            outer: Shape (num_cells, outer).
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
