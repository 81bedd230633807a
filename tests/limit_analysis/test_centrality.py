"""Test corrections that make products of static and kinematic unknowns more equal."""

from collections.abc import Sequence

import numpy as np
import pytest

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.conic.cone import NEAR, Block, Products
from perfplast_fenicsx.limit_analysis.conic.half_spaces import Pairs
from perfplast_fenicsx.limit_analysis.conic.second_order_cones import Cones, Cylinders
from perfplast_fenicsx.limit_analysis.conic.semidefinite_cones import (
    PrincipalCones,
    PrincipalPoints,
)

pytestmark = pytest.mark.serial

MU = 2.0
ONE: Floats = np.ones(1)
BLOCKS: Sequence[Block] = (
    Cylinders(slice(None), ONE, ONE, ONE, 0 * ONE),
    Cones(slice(None), ONE, ONE, ONE, ONE),
    PrincipalPoints(PrincipalCones.none(), ONE[:0]),
    Pairs(ONE),
)


def eigenvalues(products: Products) -> list[Floats]:
    """Return the eigenvalues of the products of each block."""
    *cones, matrices, pairs = products.parts
    found: list[Floats] = []
    for rows in cones:
        sizes = np.linalg.norm(rows[:, 1:], axis=1)
        found.append(np.stack([rows[:, 0] - sizes, rows[:, 0] + sizes]))
    return [*found, np.linalg.eigvalsh(matrices), pairs]


def random_products(spread: float) -> Products:
    """Return random products; some are negative if the spread is large."""
    generator = np.random.default_rng(1)
    cones, pairs = generator.normal(size=(50, 4)), generator.normal(size=50)
    half = generator.normal(size=(50, 2, 3, 3))
    matrices = (half + np.swapaxes(half, -1, -2)) / 4
    parts = [spread * cones, -spread * cones, spread * matrices, spread * pairs]
    return Products(BLOCKS, parts).raised(MU)


def test_small_and_large_ones_are_brought_near() -> None:
    products = random_products(5.0)
    assert all(values.min() < 0 for values in eigenvalues(products))
    middle = products + products.missing(MU)
    for values in eigenvalues(middle):
        assert values.min() == pytest.approx(NEAR * MU, rel=1e-9)
        assert values.max() <= MU / NEAR


def test_those_that_are_near_are_left_alone() -> None:
    products = random_products(0.1)
    assert all(values.min() > NEAR * MU for values in eigenvalues(products))
    for missing in products.missing(MU).parts:
        assert np.abs(missing).max() < 1e-12


def test_very_large_ones_are_lowered_by_a_limited_amount() -> None:
    matrices = np.broadcast_to(1e6 * np.eye(3), (1, 2, 3, 3))
    rows = np.array([[1e6, 0.0, 0.0]])
    cylinder, cone, matrix, pair = (
        Products(BLOCKS, [rows, rows, matrices, np.array([1e6])]).missing(MU).parts
    )
    assert matrix[0, 1] == pytest.approx(-MU / NEAR * np.eye(3))
    assert cylinder[0] == pytest.approx([-MU / NEAR, 0, 0])
    assert cone[0] == pytest.approx([-MU / NEAR, 0, 0])
    assert pair[0] == pytest.approx(-MU / NEAR)
