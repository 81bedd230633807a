"""Functions of PETSc's that petsc4py has no word for."""

import ctypes

from petsc4py import PETSc

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats


def call(name: str, *arguments: object) -> None:
    """Call one.

    Args:
        name: Name of the function.
        arguments: As ctypes takes them.

    Raises:
        PETSc.Error: If it fails.
    """
    failure = getattr(ctypes.CDLL(PETSc.__file__), name)(*arguments)
    if failure:
        raise PETSc.Error(failure)


def expect_entries(A: PETSc.Mat, i: npt.NDArray[np.integer], j: npt.NDArray[np.integer]) -> None:
    """Make room for entries that are given again and again, in this order. Collective.

    Args:
        A: With sizes and type.
        i: Global numbers of rows, any number of times each, of any rank's.
        j: Global numbers of columns.
    """
    rows, columns = (np.ascontiguousarray(at, dtype=PETSc.IntType) for at in (i, j))
    places = (ctypes.c_void_p(at.ctypes.data) for at in (rows, columns))
    call("MatSetPreallocationCOO", ctypes.c_void_p(A.handle), ctypes.c_int64(len(rows)), *places)


def give_entries(A: PETSc.Mat, values: Floats) -> None:
    """Set A to the sums of the entries that were given to :func:`expect_entries`. Collective."""
    given = ctypes.c_void_p(np.ascontiguousarray(values).ctypes.data)
    insert = ctypes.c_int(int(PETSc.InsertMode.INSERT_VALUES))
    call("MatSetValuesCOO", ctypes.c_void_p(A.handle), given, insert)
