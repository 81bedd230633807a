"""Call PETSc functions that petsc4py does not provide, and access PETSc arrays without a copy."""

import ctypes
from dataclasses import dataclass

from petsc4py import PETSc

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats


def call(name: str, *arguments: object) -> None:
    """Call a PETSc function.

    Args:
        name: Name of the function.
        arguments: Arguments as ctypes objects.

    Raises:
        PETSc.Error: If the function fails.
    """
    failure = getattr(ctypes.CDLL(PETSc.__file__), name)(*arguments)
    if failure:
        raise PETSc.Error(failure)


def expect_entries(A: PETSc.Mat, i: npt.NDArray[np.integer], j: npt.NDArray[np.integer]) -> None:
    """Prepare a matrix for entries that are set repeatedly, in this order. Collective.

    Args:
        A: Matrix whose sizes and type are set.
        i: Global row numbers, with repetitions, on any rank.
        j: Global column numbers.
    """
    rows, columns = (np.ascontiguousarray(at, dtype=PETSc.IntType) for at in (i, j))
    places = (ctypes.c_void_p(at.ctypes.data) for at in (rows, columns))
    call("MatSetPreallocationCOO", ctypes.c_void_p(A.handle), ctypes.c_int64(len(rows)), *places)


def give_entries(A: PETSc.Mat, values: Floats) -> None:
    """Set A to the sums of entries at the positions of :func:`expect_entries`. Collective."""
    given = ctypes.c_void_p(np.ascontiguousarray(values).ctypes.data)
    insert = ctypes.c_int(int(PETSc.InsertMode.INSERT_VALUES))
    call("MatSetValuesCOO", ctypes.c_void_p(A.handle), given, insert)


Indices = npt.NDArray[np.integer]
"""Indices in PETSc's integer type."""


@dataclass(frozen=True)
class Rows:
    """Rows of a sparse matrix in compressed storage (CSR).

    Attributes:
        pointer: Start of each row's entries, shape (num_rows + 1,).
        columns: Local column numbers of the entries.
        values: The entries, in memory of PETSc; invalid after the matrix changes.
    """

    pointer: Indices
    columns: Indices
    values: Floats


def own_rows(A: PETSc.Mat) -> tuple[Rows, Rows | None, Indices]:
    """Return this rank's rows of a matrix, with the columns of other ranks separately.

    Args:
        A: Matrix of type "aij".

    Returns:
        The entries of the rows in columns of this rank; the entries in columns of other ranks, None
        on a single rank; and the global numbers of these other columns.
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
    """Return memory of PETSc as an array."""
    if not size or not start.value:
        return np.zeros(0, dtype=of)
    memory = (ctypes.c_char * (size * np.dtype(of).itemsize)).from_address(start.value)
    return np.frombuffer(memory, dtype=of)


def forget_factors(ksp: PETSc.KSP) -> None:
    """Make a solver analyse and factorise its matrix again. Collective.

    After a zero pivot in MUMPS, PETSc treats the next factorisation as a failed analysis. PETSc
    then does nothing, reports no failure, and solves with missing factors. The solve then fails
    with INFOG(1) = −3 on all ranks (``MatFactorNumeric_MUMPS``).

    Args:
        ksp: Solver with its operators; the solver keeps its operators and options.
    """
    operators = ksp.getOperators()
    ksp.reset()
    ksp.setOperators(*operators)
