"""Test SMALBE-M and MPRGP on small random programs, against their optimality conditions."""

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx.solvers.tfeti.smalbe import DualProgram, Smalbe

SIZE, EQUALITIES = 60, 8


@pytest.mark.mpi2("1e-06-0")
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("scale", [1e-6, 1.0])
def test_optimality(seed: int, scale: float) -> None:
    rng = np.random.default_rng(seed)
    U, _ = np.linalg.qr(rng.standard_normal((SIZE, SIZE)))
    G, _ = np.linalg.qr(rng.standard_normal((SIZE, EQUALITIES)))
    P = np.eye(SIZE) - G @ G.T
    A = P @ (U * np.geomspace(1, 300, SIZE)) @ U.T @ P * scale
    b = P @ rng.standard_normal(SIZE) * 30 * scale
    bounded = np.arange(SIZE) < SIZE // 2
    lower = np.where(bounded, -0.05 * np.abs(rng.standard_normal(SIZE)), -np.inf)
    program = DualProgram(
        comm=MPI.COMM_SELF,
        multiply=lambda x: A @ x,
        project=lambda x: P @ x,
        precondition=lambda g: g / scale,
        norm=float(np.linalg.norm(A, 2)),
        b=b,
        lower=lower,
    )
    size = float(np.linalg.norm(b))
    smalbe = Smalbe(program, np.zeros(SIZE))
    assert smalbe.run(1e-4 * size, 1e-4, 1000)
    rough = smalbe.products
    assert smalbe.run(1e-11 * size, 1e-11, 1000)
    assert rough < smalbe.products
    x = smalbe.x
    assert (x >= lower).all()
    assert np.abs(G.T @ x).max() < 1e-10
    gradient = A @ x - b + smalbe.multiplier
    free = x > lower
    assert 0 < int((~free).sum()) < SIZE // 2
    assert np.abs(gradient[free]).max() < 1e-10 * size
    assert gradient[~free].min() > -1e-10 * size


def test_gives_up_where_nothing_is_feasible() -> None:
    """One unknown must not be negative and must be −1: bounds and balance exclude each other."""
    P = np.diag([0.0, 1.0])
    program = DualProgram(
        comm=MPI.COMM_SELF,
        multiply=lambda x: P @ x,
        project=lambda x: P @ x,
        precondition=lambda g: g,
        norm=1.0,
        b=np.array([0.0, 1.0]),
        lower=np.array([1.0, -np.inf]),
    )
    assert not Smalbe(program, np.zeros(2)).run(1e-10, 1e-10, 200)
