"""Test second-order cones: products, the boundary, and the scaling between two members."""

import numpy as np
import numpy.typing as npt
import pytest

from perfplast_fenicsx.limit_analysis.conic.second_order_cones import (
    Scaling,
    determinant,
    longest_step,
    product,
    quotient,
)

pytestmark = pytest.mark.serial


def members(seed: int, num: int = 50, m: int = 4) -> npt.NDArray[np.float64]:
    """Return random members, some of them close to the boundary."""
    generator = np.random.default_rng(seed)
    tails = generator.normal(size=(num, m)) * 10 ** generator.uniform(-2, 2, (num, 1))
    sizes = np.linalg.norm(tails, axis=1, keepdims=True)
    return np.hstack([sizes * (1 + 10 ** generator.uniform(-3, 1, (num, 1))), tails])


def test_quotient_undoes_product() -> None:
    a, b = members(0), members(1) - members(2)
    assert np.allclose(quotient(a, product(a, b)), b, rtol=1e-8)


def test_scaling_sends_both_to_one_point() -> None:
    s, z = members(3), members(4)
    scaling = Scaling(s, z)
    assert np.allclose(scaling.apply(z), scaling.invert(s), rtol=1e-6)
    assert np.allclose(scaling.invert(scaling.apply(s)), s, rtol=1e-6)
    inner = np.einsum("ni,ni->n", scaling.point, scaling.point)
    assert np.allclose(inner, np.einsum("ni,ni->n", s, z))


def test_moduli_are_the_inverse_of_a_block_of_the_squared_scaling() -> None:
    s, z = members(5), members(6)
    scaling = Scaling(s, z)
    a, normal = scaling.moduli()
    for axis in range(1, s.shape[1]):
        unit = np.zeros_like(s)
        unit[:, axis] = 1
        column = scaling.invert(scaling.invert(unit))[:, 1:]
        back = a[:, None] * column - np.einsum("ni,ni->n", normal, column)[:, None] * normal
        assert np.allclose(back, unit[:, 1:], atol=1e-6)


@pytest.mark.parametrize("outwards", [False, True])
def test_the_longest_step_ends_at_the_boundary(outwards: bool) -> None:
    a = members(7)
    for row in range(len(a)):
        one, along = a[row : row + 1], members(8)[row : row + 1]
        t = longest_step(one, along if outwards else -along)
        if outwards:
            assert t == np.inf
            continue
        end = one - t * along
        assert end[0, 0] >= -1e-9 * one[0, 0]
        assert abs(end[0, 0] - np.linalg.norm(end[0, 1:])) <= 1e-6 * one[0, 0]
        assert determinant(one - 0.9 * t * along)[0] > 0
    assert longest_step(a[:0], a[:0]) == np.inf
