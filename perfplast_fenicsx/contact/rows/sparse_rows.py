"""Create sparse matrices and read the entries of owned rows."""

from collections.abc import Sequence

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from scipy.sparse import coo_array

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.parallel import lasting

Sizes = tuple[int, int]
"""Number of rows or columns that this rank owns, and their number on all ranks."""

Entries = tuple[npt.NDArray[np.integer], npt.NDArray[np.integer], Floats]
"""Local rows, global columns and values, shape (n,) each."""

SharedEntries = tuple[npt.NDArray[np.integer], npt.NDArray[np.integer], Floats, Floats]
"""Rows, nodes and coefficients of terms, and their shares in the row."""


def matrix_of_entries(
    comm: MPI.Intracomm | PETSc.Comm,
    rows: Sizes,
    columns: Sizes,
    entries: Sequence[Entries],
    block_size: int = 1,
) -> PETSc.Mat:
    """Return a sparse matrix from entries in any order, without zeros. Collective.

    Args:
        comm: The ranks.
        rows: Rows of the matrix.
        columns: Columns of the matrix.
        entries: Entries in any number of parts; repeated entries are added.
        block_size: Block size of rows and columns.
    """
    none: Entries = (np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0))
    row, column, value = (np.concatenate(parts) for parts in zip(none, *entries, strict=True))
    kept = value != 0
    place = (row[kept].astype(np.int64), column[kept].astype(np.int64))
    A = coo_array((value[kept], place), shape=(rows[0], columns[1])).tocsr()
    csr = (A.indptr.astype(PETSc.IntType), A.indices.astype(PETSc.IntType), A.data)
    return PETSc.Mat().createAIJ((rows, columns), bsize=block_size, csr=csr, comm=lasting(comm))


def entries_of(A: PETSc.Mat) -> tuple[Longs, Longs, Floats]:
    """Return the owned entries, row by row."""
    pointer, column, value = A.getValuesCSR()
    row = np.repeat(np.arange(len(pointer) - 1), np.diff(pointer))
    return row, column.astype(np.int64), value


def unknowns(V: fem.FunctionSpace) -> Sizes:
    """Return the sizes of rows or columns of displacement unknowns."""
    index_map, gdim = V.dofmap.index_map, V.dofmap.index_map_bs
    return index_map.size_local * gdim, index_map.size_global * gdim
