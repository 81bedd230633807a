"""Call functions of PETSc that petsc4py does not provide."""

import ctypes

from petsc4py import PETSc

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats


def call(name: str, *arguments: object) -> None:
    """Call a function of PETSc.

    Args:
        name: Name of the function.
        arguments: Arguments in the form of ctypes.

    Raises:
        PETSc.Error: If it fails.
    """
    failure = getattr(ctypes.CDLL(PETSc.__file__), name)(*arguments)
    if failure:
        raise PETSc.Error(failure)


def expect_entries(A: PETSc.Mat, i: npt.NDArray[np.integer], j: npt.NDArray[np.integer]) -> None:
    """Prepare a matrix for entries that are set repeatedly, in this order. Collective.

    Args:
        A: Matrix with sizes and type.
        i: Global row numbers, with repetitions, on any rank.
        j: Global column numbers.
    """
    rows, columns = (np.ascontiguousarray(at, dtype=PETSc.IntType) for at in (i, j))
    places = (ctypes.c_void_p(at.ctypes.data) for at in (rows, columns))
    call("MatSetPreallocationCOO", ctypes.c_void_p(A.handle), ctypes.c_int64(len(rows)), *places)


def give_entries(A: PETSc.Mat, values: Floats) -> None:
    """Set A to the sums of the entries at the positions of :func:`expect_entries`. Collective."""
    given = ctypes.c_void_p(np.ascontiguousarray(values).ctypes.data)
    insert = ctypes.c_int(int(PETSc.InsertMode.INSERT_VALUES))
    call("MatSetValuesCOO", ctypes.c_void_p(A.handle), given, insert)
