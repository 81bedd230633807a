"""Test that equal parts of expressions become one object, which UFL need not compare."""

from collections.abc import Callable

import basix.ufl
import pytest
import ufl

from perfplast_fenicsx.materials.mandel import Expr
from perfplast_fenicsx.problem.assembled.law_on_cells import merged

PLANE = ufl.Mesh(basix.ufl.element("Lagrange", "triangle", 1, shape=(2,)))


def number_of_parts(expression: Expr) -> int:
    """Return how many objects an expression consists of."""
    seen, waiting = set[int](), [expression]
    while waiting:
        part = waiting.pop()
        if id(part) not in seen:
            seen.add(id(part))
            waiting.extend(part.ufl_operands)
    return len(seen)


def unrolled(steps: int, once: bool) -> Expr:
    """Return Newton steps for x² = 2, in which each part is made once or twice."""

    def iterate(step: int) -> Expr:
        if step == 0:
            return ufl.SpatialCoordinate(PLANE)[0]
        x = iterate(step - 1)
        again = x if once else iterate(step - 1)
        return x - (x**2 - 2) / (2 * again)

    return iterate(steps)


@pytest.mark.serial
@pytest.mark.parametrize("steps", [1, 8])
def test_equal_parts_become_one_object(steps: int) -> None:
    """An expression with 2ⁿ parts has as few parts as if equal parts were made once."""
    once, twice = merged(unrolled(steps, True)), unrolled(steps, False)
    found = merged(twice)
    assert number_of_parts(found) == number_of_parts(once)
    assert found == once


@pytest.mark.serial
@pytest.mark.parametrize(
    "make",
    [
        lambda x: ufl.as_vector([ufl.sin(x[0]), ufl.sin(x[0]), ufl.conditional(x[0] < 1, x[1], 2)]),
        lambda x: ufl.dot(x, x) * ufl.inner(ufl.grad(x), ufl.grad(x)),
        lambda x: (
            ufl.as_tensor(x[ufl.i] * x[ufl.j], (ufl.i, ufl.j))[0, 1] + ufl.tr(ufl.outer(x, x))
        ),
        lambda x: x[0],
        lambda x: ufl.as_ufl(3.0),
    ],
)
def test_an_expression_keeps_its_value(make: Callable[[Expr], Expr]) -> None:
    x = ufl.SpatialCoordinate(PLANE)
    wanted = make(x)
    assert merged(make(x)) == wanted
    assert merged(make(x)).ufl_shape == wanted.ufl_shape
