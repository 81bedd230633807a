"""Test subdomains, their rigid motions and K⁺."""

from petsc4py import PETSc

import numpy as np
import pytest

from perfplast_fenicsx.problem.fields.quadrature_fields import QuadratureFields
from perfplast_fenicsx.solvers.tfeti.subdomains import (
    Factors,
    TornStiffness,
    bisected,
    make_subdomains,
)
from tests.models import two_blocks_problem


def test_bisected_into_like_parts() -> None:
    x = np.random.default_rng(0).random((100, 3)) * (3, 1, 1)
    label = bisected(x, 5)
    assert (np.bincount(label) == 20).all()
    assert np.ptp(x[label == 0, 0]) < 0.5 * np.ptp(x[:, 0])


def test_generalised_inverse() -> None:
    """K K⁺ K = K, the kernel of K is R, and K is that of the bodies for equal motions of nodes."""
    problem = two_blocks_problem(2)
    pieces = make_subdomains(problem, 8)
    fields = QuadratureFields(problem)
    fields.update()
    K = TornStiffness(fields, pieces).at(1.0)
    K.factorise()
    forces = K.multiply(np.random.default_rng(0).standard_normal(K.size))
    assert np.abs(K.multiply(K.solve(forces)) - forces).max() < 1e-12 * np.abs(forces).max()
    R = pieces.motions.reshape(K.size, -1)
    rigid = np.column_stack([K.multiply(motion) for motion in R.T])
    assert np.abs(rigid).max() < 1e-12 * np.abs(forces).max()
    assert problem.comm.allreduce(pieces.count) == pieces.total >= 8


def test_factors_behind_a_zero_pivot() -> None:
    factors = Factors()
    told = []
    for diagonal in ([1.0, 0.0, 1.0], [1.0, 2.0, 4.0]):
        A = PETSc.Mat().createSBAIJ((3, 3), bsize=1, nnz=1, comm=PETSc.COMM_SELF)
        A.setDiagonal(PETSc.Vec().createWithArray(np.array(diagonal), comm=PETSc.COMM_SELF))
        A.assemble()
        told.append(factors.make(A))
    assert told == ["a pivot is zero", None]
    assert factors.solve(np.ones(3)) == pytest.approx([1.0, 0.5, 0.25])
