"""Test linear functions around formulas: below and above at random points, and exact if linear."""

import numpy as np
import pytest

from perfplast_fenicsx.formulas import enclosed, evaluate

pytestmark = pytest.mark.serial

WATER = "9.81*maximum(0, minimum(maximum(0.2, 0.2 + (x - 0.3)*2/3), 0.5 + (x - 0.7)/3) - y)"
STEPS = "where((x < 0.5) & (y >= 0.25), 2*x, where(x > 0.8, 3 - y, y)) - 1"
BENT = ["abs(x - y)", "x*y - 2*x**2 + y", WATER, STEPS, "minimum(z, 2*x) / 4 + sin(pi/2)"]
BENT += ["3 - 2*(x - 0.3)*(0.7 - y)/5", "(1 - x)**2 - -y*(2 - x)"]


@pytest.mark.parametrize("formula", BENT)
@pytest.mark.parametrize("corners", [3, 4])
def test_formulas_are_between(formula: str, corners: int) -> None:
    random = np.random.default_rng(3)
    places = random.random((200, corners, corners - 1)) - 0.1
    found = enclosed(formula, places, "here")
    assert found is not None
    shares = random.dirichlet(np.ones(corners), 50)
    for share in (*shares, *np.eye(corners)):
        x = np.zeros((len(places), 3))
        x[:, : corners - 1] = np.einsum("v,cvi->ci", share, places)
        low, high = (side @ share for side in found)
        value = evaluate(formula, x, "here")
        assert (low <= value + 1e-12).all()
        assert (value <= high + 1e-12).all()


def test_what_is_linear_in_a_cell_is_exact() -> None:
    """With a kink on an edge or at a vertex, a cell lies on one side of the kink."""
    cell = np.array([[[0.5, 0.25], [1.0, 0.25], [0.5, 1.0]]])
    for formula in ("where(x < 0.5, 7, 2*y)", "maximum(0, x - 0.5)", "abs(y - 0.25)*3", "4"):
        found = enclosed(formula, cell, "here")
        assert found is not None
        x = np.column_stack([cell[0], np.zeros(3)])
        for side in found:
            np.testing.assert_allclose(side[0], evaluate(formula, x, "here"), atol=1e-14)


@pytest.mark.parametrize("formula", ["sqrt(x)", "1/y", "maximum(x, y)*x", "where(x == y, 1, 2)"])
def test_what_has_no_enclosure(formula: str) -> None:
    assert enclosed(formula, np.ones((1, 3, 2)), "here") is None
