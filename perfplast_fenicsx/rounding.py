"""Define tolerances for rounding, and round bounds to a few digits such that they remain bounds."""

from collections.abc import Sequence
from decimal import ROUND_CEILING, ROUND_FLOOR, Context

ROUNDING = 1e-9
"""Share of the largest number of its kind below which a number counts as zero, in comparisons of
sums of doubles. It is far above rounding errors of the sums, and far below any intended value."""

TINY = 1e-300
"""Smallest divisor; avoids 0/0."""

DIGITS = 6
"""Number of significant digits of printed bounds."""


def without_rounding(rows: Sequence[Sequence[float]]) -> list[list[float]]:
    """Return rows of numbers, with 0 for numbers that are rounding errors of the largest number."""
    largest = max((abs(number) for row in rows for number in row), default=0.0)
    return [[number if abs(number) > ROUNDING * largest else 0.0 for number in row] for row in rows]


def rounded_up(value: float, digits: int = DIGITS) -> str:
    """Return the value as text, rounded up to a number of significant digits."""
    return _rounded(value, ROUND_CEILING, digits)


def rounded_down(value: float, digits: int = DIGITS) -> str:
    """Return the value as text, rounded down to a number of significant digits."""
    return _rounded(value, ROUND_FLOOR, digits)


def _rounded(value: float, way: str, digits: int) -> str:
    few = Context(prec=digits, rounding=way).create_decimal_from_float(value)
    return f"{float(few):.{digits}g}"
