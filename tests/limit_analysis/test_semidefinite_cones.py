"""Test semidefinite 3 × 3 matrices: scaling, products and steps against libraries."""

import numpy as np
import pytest

from perfplast_fenicsx.arrays import Floats, matrices, vectors
from perfplast_fenicsx.limit_analysis.conic.semidefinite_cones import (
    MatrixScaling,
    least_eigenvalue,
    longest_step,
    product,
)

pytestmark = pytest.mark.serial


def members(seed: int, spread: float, num: int = 200) -> Floats:
    """Return members of the cone, with eigenvalues from 10^−spread to 1."""
    random = np.random.default_rng(seed)
    axes = np.linalg.qr(random.normal(size=(num, 3, 3)))[0]
    values = 10 ** random.uniform(-spread, 0, (num, 3))
    found: Floats = (axes * values[:, None]) @ np.swapaxes(axes, 1, 2)
    return (found + np.swapaxes(found, 1, 2)) / 2


@pytest.mark.parametrize("spread", [0.0, 1.0, 5.0])
def test_both_members_are_scaled_to_one_diagonal(spread: float) -> None:
    s, z = members(1, spread), members(2, spread)
    scaling = MatrixScaling(s, z)
    diagonal = scaling.point[..., None] * np.eye(3)
    size = np.abs(scaling.point).max()
    tolerance = 1e-14 * 10**spread * size
    assert np.abs(scaling.primal(s) - diagonal).max() < tolerance
    assert np.abs(scaling.dual(z) - diagonal).max() < tolerance
    squares = np.sort(scaling.point**2, axis=1)
    theirs = np.sort(np.linalg.eigvals(s @ z).real, axis=1)
    assert np.abs(squares - theirs).max() < 1e-13 * 10**spread * theirs.max()
    a = members(3, 1.0) - 0.3 * members(4, 1.0)
    assert np.allclose(scaling.undone(scaling.dual(a)), a, rtol=0, atol=1e-13 * 10 ** (2 * spread))
    assert np.allclose(product(diagonal, scaling.quotient(a)), a, rtol=0, atol=1e-13)
    # operations on members and multipliers are adjoint: products do not change
    works = np.einsum("nij,nij->n", scaling.primal(a), scaling.dual(z))
    assert np.allclose(works, np.einsum("nij,nij->n", a, z), rtol=0, atol=1e-10 * 10**spread)


def test_steps_end_at_the_boundary() -> None:
    a = members(5, 2.0)
    da = matrices(np.random.default_rng(6).normal(size=(len(a), 6)))
    t = longest_step(a, da)
    least = np.linalg.eigvalsh(a + t * da)[:, 0]
    assert abs(least.min()) < 1e-12
    assert longest_step(a, a) == np.inf and longest_step(a[:0], da[:0]) == np.inf
    for k in range(0, len(a), 40):
        one = slice(k, k + 1)
        assert longest_step(a[one], da[one]) >= t


def test_least_eigenvalues_and_vectors() -> None:
    a = matrices(np.random.default_rng(7).normal(size=(500, 6)))
    theirs = np.linalg.eigvalsh(a)[:, 0]
    assert np.allclose(least_eigenvalue(a), theirs, rtol=0, atol=1e-12)
    equal = np.array([np.diag(d) for d in ((1.0, 1, 1), (0, 0, 0), (1, 1, 2), (1, 2, 2))])
    assert np.allclose(least_eigenvalue(equal), [1, 0, 1, 1], rtol=0, atol=1e-7)
    b = matrices(np.random.default_rng(8).normal(size=(500, 6)))
    works = np.einsum("nij,nij->n", a, b)
    assert np.allclose(np.einsum("ni,ni->n", vectors(a), vectors(b)), works, rtol=0, atol=1e-12)
