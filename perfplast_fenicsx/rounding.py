"""Thresholds of rounding, and bounds rounded to a few digits that are still bounds."""

from decimal import ROUND_CEILING, ROUND_FLOOR, Context

ROUNDING = 1e-9
"""Share of the largest of its kind below which a number counts as none, where sums of doubles are
compared: far above their rounding, far below what anybody means."""

TINY = 1e-300
"""Smallest divisor; avoids 0/0."""

DIGITS = 6
"""Significant digits in which bounds are shown."""


def rounded_up(value: float, digits: int = DIGITS) -> str:
    """Return the value in some significant digits, not less than it is."""
    return _rounded(value, ROUND_CEILING, digits)


def rounded_down(value: float, digits: int = DIGITS) -> str:
    """Return the value in some significant digits, not more than it is."""
    return _rounded(value, ROUND_FLOOR, digits)


def _rounded(value: float, way: str, digits: int) -> str:
    few = Context(prec=digits, rounding=way).create_decimal_from_float(value)
    return f"{float(few):.{digits}g}"
