"""Check formulas in the coordinates, evaluate them, and enclose them by linear functions.

A formula is parsed, and its parts are compared with a list of allowed parts. NumPy's functions then
evaluate its syntax tree; Python itself never evaluates the formula.

The enclosure consists of a linear function below and a linear function above the formula in each of
several simplices. Such a pair, given by values at the vertices, encloses each part of a formula.
The chord of a part is the linear function with the same values at the vertices. The maximum of two
linear functions is convex: its chord lies above it, and both functions lie below it. A product of
linear functions f and g differs from its chord by Σ (fᵢ − fⱼ)(gᵢ − gⱼ) λᵢλⱼ, i < j. The product
λᵢλⱼ of barycentric coordinates is at most a quarter. Sums and multiples of linear functions are
their own enclosures.
"""

import ast
import math
import operator
from collections.abc import Callable, Mapping
from itertools import combinations
from typing import Any

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.errors import LARGEST, InputError, place_of

VARIABLES = ("x", "y", "z", "pi")

FUNCTIONS = (
    *("abs", "arccos", "arccosh", "arcsin", "arcsinh", "arctan", "arctan2", "arctanh", "ceil"),
    *("cos", "cosh", "exp", "expm1", "floor", "fmod", "log", "log10", "log1p", "maximum"),
    *("minimum", "sin", "sinh", "sqrt", "tan", "tanh", "where"),
)
"""NumPy functions that formulas may call by these names; they act point by point."""

ARGUMENTS = {"arctan2": 2, "fmod": 2, "maximum": 2, "minimum": 2, "where": 3}
"""Number of arguments of functions that do not have exactly one argument."""

OPERATORS: dict[type[ast.AST], tuple[str, Callable[..., Any]]] = {
    ast.Add: ("+", operator.add),
    ast.Sub: ("-", operator.sub),
    ast.Mult: ("*", operator.mul),
    ast.Div: ("/", operator.truediv),
    ast.Pow: ("**", operator.pow),
    ast.Mod: ("%", operator.mod),
    ast.Lt: ("<", operator.lt),
    ast.LtE: ("<=", operator.le),
    ast.Gt: (">", operator.gt),
    ast.GtE: (">=", operator.ge),
    ast.Eq: ("==", operator.eq),
    ast.NotEq: ("!=", operator.ne),
    ast.BitAnd: ("&", operator.and_),
    ast.BitOr: ("|", operator.or_),
    ast.USub: ("-", operator.neg),
    ast.UAdd: ("+", operator.pos),
}
"""Symbol and function of each operator."""

LONGEST = 1000
"""Largest number of characters of a formula; this limits the parser's recursion."""

SHOWN = 60
"""Number of characters of a formula that a message quotes."""

_SILENT: tuple[type[ast.AST], ...] = (
    *(ast.Expression, ast.BinOp, ast.UnaryOp, ast.Compare),
    *(ast.Call, ast.Name, ast.Load, ast.Constant),
)

_FAILURES = (
    *(ArithmeticError, LookupError, MemoryError, RecursionError),
    *(NotImplementedError, SyntaxError, TypeError, ValueError),
)
"""Exceptions that Python's parser and NumPy raise for text that is not a formula."""


class WordedFormula(str):
    """A formula that the program has written, with words that describe it.

    Attributes:
        words: Words, with the unit, that a reader sees instead of the formula.
    """

    words: str

    def __new__(cls, formula: str, words: str) -> "WordedFormula":
        """Return the formula with its words."""
        made = super().__new__(cls, formula)
        made.words = words
        return made

    def __reduce__(self) -> tuple[type["WordedFormula"], tuple[str, str]]:
        """Return the class and the arguments for a copy."""
        return type(self), (str(self), self.words)


def evaluate(formula: float | str, x: Floats, place: str) -> Floats:
    """Return the values of a formula in x, y, z at points.

    Not collective: every rank refuses the same formulas, but only the rank with the point sees a
    value that is not finite.

    Args:
        formula: A number, or a formula such as ``"0.02*(x**2 + y**2)"``.
        x: Coordinates, shape (num_points, 3).
        place: Place of the formula in the input, for messages.

    Returns:
        Values, shape (num_points,).

    Raises:
        InputError: If a formula cannot be read, has parts other than numbers, x, y, z, pi,
            operators and :data:`FUNCTIONS`, or has a value that is not finite.
    """
    if isinstance(formula, str):
        formula = " ".join(formula.split())
        check(formula, place)
        names = dict(zip("xyz", x.T, strict=True)) | {"pi": np.float64(math.pi)}
        try:
            with np.errstate(all="ignore"):
                value = _value(ast.parse(formula, mode="eval").body, names)
        except _FAILURES as error:
            raise _refusal(formula, place, f"cannot be evaluated ({error})") from error
    else:
        value = np.asarray(formula, dtype=np.float64)
    values = np.array(np.broadcast_to(value, len(x)), dtype=np.float64)
    wrong = ~np.isfinite(values)
    if wrong.any():
        at = place_of(x[np.argmax(wrong)])
        raise InputError(
            f"{place}: {_quoted(formula)} is {values[wrong][0]} at {at}; give a number, or a "
            "formula that is finite at this point."
        )
    largest = np.abs(values).max(initial=0)
    if largest > LARGEST:
        raise InputError(
            f"{place}: {_quoted(formula)} has the magnitude {largest:.6g}, which is too large to "
            f"compute with; keep it below {LARGEST:g}."
        )
    return values


def check(formula: str, place: str) -> None:
    """Refuse a formula that is too long or has parts that are not allowed.

    Raises:
        InputError: If a part is not allowed; the message names the first such part and the allowed
            parts.
    """
    if len(formula) > LONGEST:
        raise InputError(
            f"{place}: the formula '{_cut(formula)}' has {len(formula)} characters, more than"
            f" {LONGEST}; shorten it."
        )
    try:
        tree = ast.parse(formula, mode="eval")
    except _FAILURES as error:
        raise _refusal(formula, place, "cannot be read") from error
    nodes = list(ast.walk(tree))
    functions = {id(node.func) for node in nodes if isinstance(node, ast.Call)}
    faults = (_fault(node, id(node) in functions) for node in nodes)
    fault = next((text for text in faults if text is not None), None)
    if fault is not None:
        raise _refusal(formula, place, fault)


def _fault(node: ast.AST, called: bool) -> str | None:
    """Return why a node of the syntax tree is not allowed, in words; None if it is allowed."""
    if isinstance(node, ast.Name):
        if called and node.id not in FUNCTIONS:
            return f"calls '{node.id}'"
        if not called and node.id not in VARIABLES:
            return f"has the name '{node.id}'"
    elif isinstance(node, ast.Constant):
        if type(node.value) not in (int, float):
            return f"has {node.value!r}"
    elif isinstance(node, ast.Call):
        if not isinstance(node.func, ast.Name) or node.keywords:
            return f"has '{ast.unparse(node)}'"
        wanted = ARGUMENTS.get(node.func.id, 1)
        if len(node.args) != wanted:
            return f"gives '{node.func.id}' {len(node.args)} arguments and not {wanted}"
    elif isinstance(node, ast.Compare):
        if len(node.ops) > 1:
            return f"has the chained comparison '{ast.unparse(node)}'"
    elif isinstance(node, ast.BitXor):
        return "has '^' (powers are written **)"
    elif not isinstance(node, (*_SILENT, *OPERATORS)):
        what = ast.unparse(node) if isinstance(node, ast.expr) else type(node).__name__.lower()
        return f"has '{what}'"
    return None


def _value(node: ast.AST, names: Mapping[str, Any]) -> Any:
    """Return the value of a part of a formula that has passed the check.

    The function converts integers to floats, so 9**9**9 overflows at once and does not occupy the
    machine.
    """
    match node:
        case ast.Constant(value=number):
            return np.float64(number)
        case ast.Name(id=name):
            return names[name]
        case ast.Call(func=ast.Name(id=name), args=arguments):
            return getattr(np, name)(*(_value(argument, names) for argument in arguments))
        case ast.UnaryOp(op=sign, operand=operand):
            return OPERATORS[type(sign)][1](_value(operand, names))
        case ast.BinOp(left=left, op=sign, right=right):
            return OPERATORS[type(sign)][1](_value(left, names), _value(right, names))
        case ast.Compare(left=left, ops=[sign], comparators=[right]):
            return OPERATORS[type(sign)][1](_value(left, names), _value(right, names))
    raise ValueError(f"'{ast.unparse(node)}' was not checked")


def _quoted(formula: float | str) -> str:
    return f"the formula '{_cut(formula)}'" if isinstance(formula, str) else str(formula)


def _cut(formula: str) -> str:
    return formula if len(formula) <= SHOWN else f"{formula[:SHOWN]}..."


def _refusal(formula: str, place: str, fault: str) -> InputError:
    operators = " ".join(dict.fromkeys(sign for sign, _ in OPERATORS.values()))
    return InputError(
        f"{place}: the formula '{_cut(formula)}' {_cut(fault)}; allowed are numbers,"
        f" {', '.join(VARIABLES)}, parentheses, {operators} and the functions"
        f" {', '.join(FUNCTIONS)}."
    )


ROUNDING = 1e-12
"""Relative difference below which the two sides of a comparison count as equal. It matters only
in simplices in which the sign of the difference changes between vertices.
"""

Pair = tuple[Floats, Floats]
"""Two linear functions by their values at vertices: one nowhere above a formula, and one nowhere
below it.
"""

TRUE, SOMETIMES, FALSE = 1.0, 0.5, 0.0


class _UnknownFormula(Exception):
    """Raised if no enclosure of a part of a formula is known."""


def enclosed(formula: float | str, corners: Floats, place: str) -> Pair | None:
    """Return linear functions below and above a formula in each simplex. Not collective.

    Args:
        formula: A number, or a formula in x, y and z.
        corners: Vertices of the simplices, shape (n, k, d).
        place: Place of the formula in the input, for messages.

    Returns:
        Values at the vertices, both of shape (n, k). None if the formula has parts other than sums,
        products of linear parts, ``abs``, ``minimum``, ``maximum``, and ``where`` with comparisons,
        or if a value is not finite.

    Raises:
        InputError: If the formula has parts that are not allowed.
    """
    shape = corners.shape[:2]
    found: Any = float(formula) if not isinstance(formula, str) else None
    if found is None:
        text = " ".join(str(formula).split())
        check(text, place)
        none = np.zeros(shape)
        at = [corners[..., i] if i < corners.shape[2] else none for i in range(3)]
        names = {name: (x, x) for name, x in zip("xyz", at, strict=True)} | {"pi": np.pi}
        try:
            found = _enclosed_value(ast.parse(text, mode="eval").body, names)
        except _UnknownFormula:
            return None
    low, high = found if isinstance(found, tuple) else (found, found)
    low, high = np.broadcast_to(low, shape), np.broadcast_to(high, shape)
    return (low, high) if np.isfinite(low).all() and np.isfinite(high).all() else None


def _enclosed_value(node: ast.AST, names: dict[str, Any]) -> Any:
    """Return a number for a constant part of a formula, and an enclosure for another part."""
    match node:
        case ast.Constant(value=number):
            return float(number)
        case ast.Name(id=name):
            return names[name]
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return _negative(_enclosed_value(operand, names))
        case ast.UnaryOp(op=ast.UAdd(), operand=operand):
            return _enclosed_value(operand, names)
        case ast.BinOp(left=left, op=sign, right=right):
            return _combined(sign, _enclosed_value(left, names), _enclosed_value(right, names))
        case ast.Call(func=ast.Name(id="where"), args=[condition, one, other]):
            return _chosen(
                _holds(condition, names), _enclosed_value(one, names), _enclosed_value(other, names)
            )
        case ast.Call(func=ast.Name(id=name), args=arguments):
            return _function(name, [_enclosed_value(it, names) for it in arguments])
    raise _UnknownFormula


def _function(name: str, values: list[Any]) -> Any:
    """Return the value of a function of numbers, or its enclosure if an argument is a pair."""
    if not any(isinstance(it, tuple) for it in values):
        with np.errstate(all="ignore"):
            return float(getattr(np, name)(*values))
    if name == "maximum":
        return _larger(*values)
    if name == "minimum":
        return _negative(_larger(*map(_negative, values)))
    if name == "abs":
        return _larger(values[0], _negative(values[0]))
    raise _UnknownFormula


def _combined(sign: ast.operator, one: Any, other: Any) -> Any:
    """Return the result of an operation on two numbers, or its enclosure if one is a pair."""
    numbers = not isinstance(one, tuple) and not isinstance(other, tuple)
    if numbers and type(sign) in OPERATORS:
        with np.errstate(all="ignore"):
            return float(OPERATORS[type(sign)][1](np.float64(one), np.float64(other)))
    if isinstance(sign, ast.Add):
        return _each(operator.add, _pair(one), _pair(other))
    if isinstance(sign, ast.Sub):
        return _combined(ast.Add(), one, _negative(other))
    if isinstance(sign, ast.Mult):
        return _product(one, other)
    if isinstance(sign, ast.Div) and not isinstance(other, tuple) and other:
        return _product(one, 1 / other)
    if isinstance(sign, ast.Pow) and other == 2:
        return _product(one, one)
    raise _UnknownFormula


def _pair(value: Any) -> Any:
    return value if isinstance(value, tuple) else (value, value)


def _each(function: Callable[..., Floats], *pairs: Pair) -> Pair:
    """Return ``function`` of the lower members and of the upper members of pairs.

    If both members of each pair are the same array, so are both results.
    """
    low = function(*(it[0] for it in pairs))
    linear = all(it[0] is it[1] for it in pairs)
    return low, low if linear else function(*(it[1] for it in pairs))


def _negative(value: Any) -> Any:
    return _each(operator.neg, value[::-1]) if isinstance(value, tuple) else -value


def _larger(one: Any, other: Any) -> Any:
    """Return an enclosure of the maximum of two values, of which at least one is a pair."""
    (a, b), (c, d) = _pair(one), _pair(other)
    high = np.maximum(b, d)
    a, c = np.broadcast_to(a, high.shape), np.broadcast_to(c, high.shape)
    first = a.mean(axis=1, keepdims=True) >= c.mean(axis=1, keepdims=True)
    return np.where(first, a, c), high


def _product(one: Any, other: Any) -> Any:
    """Return an enclosure of the product of two values."""
    if not isinstance(one, tuple):
        one, other = other, one
    if not isinstance(other, tuple):
        return _each(lambda side: side * other, one if other >= 0 else one[::-1])
    if one[0] is not one[1] or other[0] is not other[1]:
        raise _UnknownFormula  # a factor is not linear
    return linear_product(one[0], other[0])


def linear_product(f: Floats, g: Floats) -> Pair:
    """Return linear functions below and above the product of two linear functions.

    Args:
        f: Values of the first function at the vertices of simplices, shape (n, k).
        g: Values of the second function, same shape.
    """
    low, high = f * g, f * g
    for i, j in combinations(range(f.shape[1]), 2):
        bent = (f[:, i] - f[:, j]) * (g[:, i] - g[:, j]) / 4
        low = low - np.maximum(bent, 0.0)[:, None]
        high = high + np.maximum(-bent, 0.0)[:, None]
    return low, high


def _holds(node: ast.AST, names: dict[str, Any]) -> Any:
    """Return whether a condition holds everywhere, in a part or nowhere in each simplex."""
    match node:
        case ast.Compare(left=left, ops=[sign], comparators=[right]):
            one, other = _enclosed_value(left, names), _enclosed_value(right, names)
            if isinstance(sign, (ast.Gt, ast.GtE)):
                one, other = other, one
            elif not isinstance(sign, (ast.Lt, ast.LtE)):
                raise _UnknownFormula
            (a, b), (c, d) = _pair(one), _pair(other)
            sizes = [np.abs(it).max(initial=0.0) for it in (a, b, c, d)]
            little = ROUNDING * max(sizes)
            never, always = np.atleast_2d(a - d) >= -little, np.atleast_2d(b - c) <= little
            return np.where(always.all(axis=1), TRUE, np.where(never.all(axis=1), FALSE, SOMETIMES))
        case ast.BinOp(left=left, op=ast.BitAnd(), right=right):
            return np.minimum(_holds(left, names), _holds(right, names))
        case ast.BinOp(left=left, op=ast.BitOr(), right=right):
            return np.maximum(_holds(left, names), _holds(right, names))
    raise _UnknownFormula


def _chosen(holds: Floats, one: Any, other: Any) -> Pair:
    """Return an enclosure of ``one`` where a condition holds, and of ``other`` elsewhere."""
    (a, b), (c, d) = _pair(one), _pair(other)
    told = holds[:, None]
    low = np.where(told == TRUE, a, np.where(told == FALSE, c, np.minimum(a, c)))
    high = np.where(told == TRUE, b, np.where(told == FALSE, d, np.maximum(b, d)))
    return low, high
