"""Check formulas in the coordinates, from case files, and evaluate them with NumPy.

A formula is parsed and compared with a list of allowed parts. Its syntax tree is then evaluated
with NumPy's functions; Python itself never evaluates it.
"""

import ast
import math
import operator
from collections.abc import Callable, Mapping
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
"""Number of arguments of a function, if it is not one."""

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
"""Largest number of characters of a formula; it limits the parser's recursion."""

SHOWN = 60
"""Number of characters of a formula that a message shows."""

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
    """A formula that the program has written, with words for it.

    Attributes:
        words: Words that replace the formula for a reader, with the unit.
    """

    words: str

    def __new__(cls, formula: str, words: str) -> "WordedFormula":
        """Return the formula with its words."""
        made = super().__new__(cls, formula)
        made.words = words
        return made

    def __reduce__(self) -> tuple[type["WordedFormula"], tuple[str, str]]:
        """Return the class and arguments of a copy."""
        return type(self), (str(self), self.words)


def evaluate(formula: float | str, x: Floats, place: str) -> Floats:
    """Return values of a formula in x, y, z at points.

    Not collective: every rank refuses the same formulas, but only the rank with the point sees a
    value that is not finite.

    Args:
        formula: A number, or a formula such as ``"0.02*(x**2 + y**2)"``.
        x: Coordinates, shape (num_points, 3).
        place: Place of the formula in the input, for messages.

    Returns:
        Shape (num_points,).

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
            f"{place}: {_quoted(formula)} is {values[wrong][0]} at {at}; give a number or formula"
            " that is finite wherever it is needed."
        )
    largest = np.abs(values).max(initial=0)
    if largest > LARGEST:
        raise InputError(
            f"{place}: {_quoted(formula)} is as large as {largest:.6g}, too large to compute with;"
            f" stay below {LARGEST:g}."
        )
    return values


def check(formula: str, place: str) -> None:
    """Refuse a formula with parts that are not allowed.

    Raises:
        InputError: With the first such part, and the allowed ones.
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
    """Return the fault of one node of the syntax tree, or None."""
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
    """Return the value of a part of a formula that has been checked.

    Integers count as floats: 9**9**9 overflows at once and does not occupy the machine.
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
