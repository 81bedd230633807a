"""Test that the dense program of contact and friction satisfies the conditions of both."""

import numpy as np
import pytest

from perfplast_fenicsx.solvers.active_set.friction_qp import moves_of

pytestmark = pytest.mark.serial


@pytest.mark.parametrize("seed", range(20))
def test_moves_fulfil_contact_and_friction(seed: int) -> None:
    random = np.random.default_rng(seed)
    n = 12
    root = random.normal(size=(n, n))
    S, is_place = root @ root.T + 0.1 * np.eye(n), np.arange(n) >= n // 2
    bound = np.where(is_place, random.uniform(0, 2, n), 0.0)
    bound[-1] = np.inf
    G = 3 * random.normal(size=n)
    signs = moves_of(S, G, bound, is_place)
    free = signs != 0
    moved = np.zeros(n)
    moved[free] = np.linalg.solve(S[np.ix_(free, free)], -(G + np.sign(signs) * _c(bound))[free])
    assert (np.sign(moved) == np.sign(signs)).all()
    left = G + S @ moved
    assert (left[~is_place & ~free] <= 1e-9).all()  # closed pairs push
    assert (signs[~is_place] <= 0).all()
    sticks = is_place & ~free
    assert (np.abs(left[sticks]) <= bound[sticks] + 1e-9).all()
    assert signs[-1] == pytest.approx(0.0)


def _c(bound: np.ndarray) -> np.ndarray:
    return np.where(np.isfinite(bound), bound, 0.0)
