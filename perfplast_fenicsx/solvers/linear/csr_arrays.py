"""Access PETSc's arrays of a rank's matrix rows, without a copy."""

import ctypes
from dataclasses import dataclass

from petsc4py import PETSc

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.solvers.linear.petsc_calls import call

Indices = npt.NDArray[np.integer]
"""Indices of PETSc's type of integers."""


@dataclass(frozen=True)
class Rows:
    """Compressed rows.

    Attributes:
        pointer: Beginning of each row's entries, shape (num_rows + 1,).
        columns: Columns of the entries, local numbers.
        values: The entries in PETSc's memory: invalid after the matrix changes.
    """

    pointer: Indices
    columns: Indices
    values: Floats


def own_rows(A: PETSc.Mat) -> tuple[Rows, Rows | None, Indices]:
    """Return the rows of this rank.

    Args:
        A: Matrix of type "aij".

    Returns:
        The rows in columns of this rank; those in columns of other ranks, None on a single rank;
        and the global numbers of these columns.
    """
    handle, none = ctypes.c_void_p(A.handle), np.zeros(0, dtype=PETSc.IntType)
    if A.comm.getSize() == 1:
        return _rows(handle, A.getLocalSize()[0]), None, none
    here, there, columns = ctypes.c_void_p(), ctypes.c_void_p(), ctypes.c_void_p()
    call("MatMPIAIJGetSeqAIJ", handle, *map(ctypes.byref, (here, there, columns)))
    count = A.getLocalSize()[0]
    beyond = _rows(there, count)
    size = int(beyond.columns.max(initial=-1)) + 1  # PETSc numbers only columns with entries
    return _rows(here, count), beyond, _array(columns, size, PETSc.IntType)


def _rows(sequential: ctypes.c_void_p, count: int) -> Rows:
    """Return the rows of a sequential matrix."""
    i, j, a, memory = ctypes.c_void_p(), ctypes.c_void_p(), ctypes.c_void_p(), ctypes.c_int()
    call("MatSeqAIJGetCSRAndMemType", sequential, *map(ctypes.byref, (i, j, a, memory)))
    pointer = _array(i, count + 1, PETSc.IntType)
    entries = int(pointer[-1])
    return Rows(pointer, _array(j, entries, PETSc.IntType), _array(a, entries, np.float64))


def _array(start: ctypes.c_void_p, size: int, of: type[np.generic]) -> npt.NDArray:
    """Return memory as an array."""
    if not size or not start.value:
        return np.zeros(0, dtype=of)
    memory = (ctypes.c_char * (size * np.dtype(of).itemsize)).from_address(start.value)
    return np.frombuffer(memory, dtype=of)
