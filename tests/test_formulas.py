"""Test formulas in x, y, z: their values, and refusals before any evaluation."""

import numpy as np
import pytest

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.formulas import ARGUMENTS, FUNCTIONS, LONGEST, evaluate

pytestmark = pytest.mark.serial

X = np.array([[0.0, 0.0, 0.0], [0.5, -1.0, 2.0], [3.0, 0.25, -0.125]])
x, y, z = X.T


@pytest.mark.parametrize(
    ("formula", "expected"),
    [
        (0.25, 0.25),
        (1, 1.0),
        ("1", 1.0),
        ("pi/2", np.pi / 2),
        ("0.02*(x**2 + y**2)", 0.02 * (x**2 + y**2)),
        ("-x % 2 + 1e-3", -x % 2 + 1e-3),
        ("2**-1 * z", z / 2),
        ("where((x < 1) & (y >= 0), sqrt(x), abs(z))", np.where((x < 1) & (y >= 0), x, abs(z))),
        ("x == 0", x == 0),
        ("arctan2(y, x) +\n  fmod(z, 2)", np.arctan2(y, x) + np.fmod(z, 2)),
    ],
)
def test_value(formula: float | str, expected: object) -> None:
    values = evaluate(formula, X, "here")
    assert values.shape == (3,)
    assert values.dtype == np.float64
    # functions come from different libraries, which round the last digits differently
    np.testing.assert_allclose(values, np.broadcast_to(expected, 3), rtol=1e-14, atol=0)


def test_values_are_writable_and_may_be_none_at_all() -> None:
    evaluate("2", X, "here")[0] = 1.0
    assert evaluate("1/x", np.zeros((0, 3)), "here").shape == (0,)
    with pytest.raises(InputError, match="'w'"):
        evaluate("w", np.zeros((0, 3)), "here")


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_function_that_is_named_exists(name: str) -> None:
    count = ARGUMENTS.get(name, 1)
    arguments = ", ".join(["x > 0.75", "x", "y"] if count == 3 else ["x", "y"][:count])
    point = np.array([[1.0, 0.5, 0.0]])
    assert np.isfinite(evaluate(f"{name}({arguments})", point, "here") if name != "arctanh" else 0)


@pytest.mark.parametrize(
    ("formula", "fault"),
    [
        ("", "cannot be read"),
        ("x +", "cannot be read"),
        ("(" * 400 + "x", "cannot be read"),
        ("x; y", "cannot be read"),
        ("w + 1", "'w'"),
        ("__import__('os').system('true')", "'os'|__import__"),
        ("open('file')", "open"),
        ("x.real", "x.real"),
        ("x.__class__", "__class__"),
        ("x[0]", "x\\[0\\]"),
        ("'text'", "text"),
        ("True", "True"),
        ("1j*x", "1j"),
        ("lambda: x", "lambda"),
        ("[x for x in y]", "for"),
        ("x if y else z", "if"),
        ("(x := y)", ":="),
        ("x and y", "and"),
        ("x ^ 2", "powers are written"),
        ("x // 2", "floordiv"),
        ("0 < x < 1", "chained"),
        ("max(x)", "'max'"),
        ("sin(x, y)", "2 arguments"),
        ("sqrt(x=1)", "sqrt"),
        ("sin", "'sin'"),
    ],
)
def test_refused(formula: str, fault: str) -> None:
    with pytest.raises(InputError, match=fault) as caught:
        evaluate(formula, X, "case.toml, [[contact]]: gap")
    message = str(caught.value)
    assert message.startswith("case.toml, [[contact]]: gap: the formula '")
    assert "allowed are numbers, x, y, z, pi" in message
    assert "\n" not in message


def test_deep_nesting_ends_in_a_value_or_a_refusal() -> None:
    """The current depth of Python's stack determines which."""
    try:
        assert np.allclose(evaluate("-" * 900 + "x", X, "here"), x)
    except InputError as error:
        assert "cannot be" in str(error)


def test_too_long_is_refused() -> None:
    with pytest.raises(InputError, match="characters"):
        evaluate("x" + "+x" * LONGEST, X, "here")


@pytest.mark.parametrize(
    ("formula", "value"),
    [
        ("1/x", "inf"),
        ("9**9**9**9", "inf"),
        ("10**400", "inf"),
        ("log(x - 1)", "nan"),
        (float("nan"), "nan"),
        (float("-inf"), "-inf"),
    ],
)
def test_not_finite_is_refused(formula: float | str, value: str) -> None:
    with pytest.raises(InputError, match=rf"{value} at \(0, 0, 0\)"):
        evaluate(formula, X, "here")
