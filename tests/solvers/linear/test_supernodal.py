"""Test CHOLMOD factors instead of MUMPS factors: where they are used, and where not."""

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import pytest

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.conic.discretisation import NONE, SprungMatrix
from perfplast_fenicsx.solvers.linear.factorisation import DIRECT, Analysis, SupernodalFactors
from perfplast_fenicsx.solvers.linear.petsc_options import LIMIT

pytestmark = pytest.mark.serial


def dense(size: int) -> Floats:
    """Return a full matrix that is positive definite."""
    rows = np.random.default_rng(7).normal(size=(size, size))
    return np.asarray(rows @ rows.T / size + np.eye(size))


def solved(sprung: SprungMatrix, matrix: PETSc.Mat, values: Floats) -> float:
    """Return the error of a solution, with the factors of other values."""
    places = np.arange(len(values), dtype=np.int32)
    matrix.setValues(places, places, values)
    matrix.assemble()
    sprung.factorise()
    b, x = matrix.createVecs()
    b.set(1.0)
    sprung.solve(b, x)
    left = float(np.abs(values @ x.array_r - 1).max())
    b.destroy()
    x.destroy()
    return left


def test_what_is_not_positive_definite_is_factorised_by_mumps(
    capfd: pytest.CaptureFixture[str],
) -> None:
    """After one such matrix, MUMPS is always used, without a message of CHOLMOD on the terminal."""
    values = dense(700)
    matrix = PETSc.Mat().createAIJ((700, 700), nnz=700, comm=MPI.COMM_SELF)
    indefinite = values.copy()
    indefinite[3, 3] = -5.0
    sprung = SprungMatrix(MPI.COMM_SELF, matrix, NONE, DIRECT)
    assert solved(sprung, matrix, values) < 1e-10
    # PyPI's PETSc has no CHOLMOD
    assert sprung.uses == ("cholmod" if PETSc.Sys.hasExternalPackage("cholmod") else "mumps")
    assert solved(sprung, matrix, indefinite) < 1e-8
    assert sprung.uses == "mumps"
    assert solved(sprung, matrix, values) < 1e-10
    assert sprung.uses == "mumps"
    assert sprung.counts.factorisations == 3
    sprung.destroy()
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(("per_entry", "asked"), [(100.0, False), (1000.0, True)])
def test_mumps_stays_where_it_is_quicker_or_asked_for(per_entry: float, asked: bool) -> None:
    """MUMPS remains in 2D, and if users have selected a solver."""
    ksp = PETSc.KSP().create(MPI.COMM_SELF)
    factors, options = SupernodalFactors(), PETSc.Options()
    option = f"{LIMIT}pc_factor_mat_solver_type"
    if asked:
        options[option] = "mumps"
    try:
        factors.take_over(ksp, Analysis(1e9, per_entry, 1e6), LIMIT)
    finally:
        options.delValue(option)
    assert factors.factorise(PETSc.Mat()) is None
    ksp.destroy()
