"""The length of a Newton step: where the derivative of the energy along it vanishes.

The energy is convex, so that its derivative φ'(β) does not fall and bisection finds the zero.
"""

from collections.abc import Callable

Slope = Callable[[float], float]
"""φ'(β); collective."""

SLOPE_REDUCTION = 1e-3
"""A shortened step ends where |φ'(β)| is at most this share of |φ'(0)|."""

MOST_BISECTIONS = 40

LONGEST = 1.5
"""A step is stretched to so many times its length at most; twice is too far where bodies bend."""

STRETCHABLE = 0.1
"""A step is stretched where at least this share of φ'(0) is left at its end, and until no more is:
cells that yield spread from step to step, so that each falls short of the solution."""


def shortened(slope: Slope, enough: float) -> float:
    """β in (0, 1) where φ' vanishes, for φ'(0) < 0 < φ'(1). Collective.

    Args:
        slope: φ'.
        enough: |φ'| that counts as zero.
    """
    return _bisected(slope, 0.0, 1.0, enough)


def stretched(slope: Slope, at_zero: float, at_one: float, longest: float) -> float:
    """β ≥ 1 up to which the energy goes on falling much, for φ'(0) < 0. Collective.

    Args:
        slope: φ'.
        at_zero: φ'(0).
        at_one: φ'(1).
        longest: How long the step may be.
    """
    enough = STRETCHABLE * abs(at_zero)
    if longest <= 1 or at_one >= -enough:
        return 1.0
    return longest if slope(longest) <= 0 else _bisected(slope, 1.0, longest, enough)


def _bisected(slope: Slope, low: float, high: float, enough: float) -> float:
    """β between two, at which φ' is negative and positive, where it is zero."""
    for _ in range(MOST_BISECTIONS):
        middle = (low + high) / 2
        here = slope(middle)
        if abs(here) <= enough:
            return middle
        low, high = (middle, high) if here < 0 else (low, middle)
    return high
