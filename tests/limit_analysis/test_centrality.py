"""Corrections that bring products of static and kinematic unknowns nearer to one another."""

import numpy as np
import pytest

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.conic.centrality import NEAR, Products

pytestmark = pytest.mark.serial

MU = 2.0


def eigenvalues(cones: Floats) -> Floats:
    sizes = np.linalg.norm(cones[:, 1:], axis=1)
    return np.stack([cones[:, 0] - sizes, cones[:, 0] + sizes])


def random_products(spread: float) -> Products:
    """Some of the products negative where the spread is large."""
    generator = np.random.default_rng(1)
    cones, pairs = generator.normal(size=(50, 4)), generator.normal(size=50)
    half = generator.normal(size=(50, 2, 3, 3))
    matrices = (half + np.swapaxes(half, -1, -2)) / 4
    return Products(spread * cones, spread * matrices, spread * pairs).raised(MU)


def test_small_and_large_ones_are_brought_near() -> None:
    products = random_products(5.0)
    assert eigenvalues(products.cones).min() < 0
    middle = products + products.missing(MU)
    spectrum = np.linalg.eigvalsh(products.matrices)
    assert spectrum.min() < 0
    for values in (eigenvalues(middle.cones), np.linalg.eigvalsh(middle.matrices), middle.pairs):
        assert values.min() == pytest.approx(NEAR * MU, rel=1e-9)
        assert values.max() <= MU / NEAR


def test_those_that_are_near_are_left_alone() -> None:
    products = random_products(0.1)
    assert eigenvalues(products.cones).min() > NEAR * MU
    assert np.linalg.eigvalsh(products.matrices).min() > NEAR * MU
    missing = products.missing(MU)
    assert np.abs(missing.cones).max() < 1e-12
    assert np.abs(missing.matrices).max() < 1e-12
    assert np.abs(missing.pairs).max() < 1e-12


def test_very_large_ones_are_lowered_by_a_limited_amount() -> None:
    matrices = np.broadcast_to(1e6 * np.eye(3), (1, 2, 3, 3))
    products = Products(np.array([[1e6, 0.0, 0.0]]), matrices, np.array([1e6]))
    missing = products.missing(MU)
    assert missing.matrices[0, 1] == pytest.approx(-MU / NEAR * np.eye(3))
    assert missing.cones[0] == pytest.approx([-MU / NEAR, 0, 0])
    assert missing.pairs[0] == pytest.approx(-MU / NEAR)
