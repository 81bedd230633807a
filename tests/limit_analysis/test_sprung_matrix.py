"""Test factors of a stiffness with springs after a singular stiffness."""

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import pytest

from perfplast_fenicsx.limit_analysis.conic.discretisation import (
    NONE,
    SingularStiffness,
    SprungMatrix,
)
from perfplast_fenicsx.solvers.linear.factorisation import DIRECT


def test_after_a_singular_stiffness_the_next_one_is_factorised(comm: MPI.Intracomm) -> None:
    """PETSc would otherwise continue with factors that MUMPS does not have."""
    matrix = PETSc.Mat().createAIJ(((4, None), (4, None)), nnz=1, comm=comm)
    diagonal = matrix.createVecRight()
    b, x = diagonal.duplicate(), diagonal.duplicate()
    b.set(1.0)
    sprung = SprungMatrix(comm, matrix, NONE, DIRECT)
    for entry in (1.0, 0.0, 2.0):
        diagonal.set(1.0)
        diagonal.array[1] = entry
        matrix.setDiagonal(diagonal)
        matrix.assemble()
        if entry > 0:
            sprung.factorise()
            sprung.solve(b, x)
            np.testing.assert_allclose(x.array, [1, 1 / entry, 1, 1])
        else:
            with pytest.raises(SingularStiffness):
                sprung.factorise()
    sprung.destroy()
    assert sprung.counts.factorisations == 3
