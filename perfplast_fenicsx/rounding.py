"""Bounds in a few digits, so that what is shown is a bound as well."""

from decimal import ROUND_CEILING, ROUND_FLOOR, Context

DIGITS = 6


def rounded_up(value: float) -> str:
    """The value in six significant digits, not less than it is."""
    return _rounded(value, ROUND_CEILING)


def rounded_down(value: float) -> str:
    """The value in six significant digits, not more than it is."""
    return _rounded(value, ROUND_FLOOR)


def _rounded(value: float, way: str) -> str:
    digits = Context(prec=DIGITS, rounding=way).create_decimal_from_float(value)
    return f"{float(digits):.{DIGITS}g}"
