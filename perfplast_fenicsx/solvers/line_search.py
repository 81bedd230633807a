"""The length of a Newton step: where the derivative of the energy along it vanishes.

The energy is convex, so that its derivative φ'(β) does not fall and bisection finds the zero.
"""

from collections.abc import Callable

Slope = Callable[[float], float]
"""φ'(β); collective."""

SLOPE_REDUCTION = 1e-3
"""A shortened step ends where |φ'(β)| is at most this share of |φ'(0)|."""


LONGEST = 1.5
"""A step is stretched to so many times its length at most; twice is too far where bodies bend."""

STRETCHABLE = 0.1
"""A step is stretched where at least this share of φ'(0) is left at its end, and until no more is.
Cells that yield spread from step to step, so that each falls short of the solution."""


def step_length(
    slope: Slope,
    noise: Callable[[], tuple[float, float]],
    longest: Callable[[], float] | None = None,
    kinked: bool = False,
) -> float:
    """β = argmin over (0, 1] of the energy, or up to ``longest`` where it falls on much at 1.

    β = 1 is taken where φ' is not positive there, or so small against φ'(0), or against what it is
    the difference of, that nothing is to be gained. Collective.

    Args:
        slope: φ'.
        noise: Rounding errors of φ' as a sum, and of that with what it is a sum of; asked only
            where they decide.
        longest: How long the step may be; None for no longer than 1.
        kinked: Whether the energy has kinks that a step may be wrong about: where it rises from
            the start on, β = 0, and the next step knows better.
    """
    at_zero, at_one = slope(0.0), slope(1.0)
    if -STRETCHABLE * abs(at_zero) <= at_one <= SLOPE_REDUCTION * abs(at_zero):
        return 1.0
    of_sum, of_all = noise()
    enough = max(SLOPE_REDUCTION * abs(at_zero), of_sum)
    if at_one > max(enough, of_all) and at_zero < -of_sum:
        return _bisected(slope, 0.0, 1.0, enough)
    if kinked and at_one > max(enough, of_all) and at_zero > max(of_sum, of_all):
        return 0.0
    if longest is None or at_zero >= -of_all or at_one >= -STRETCHABLE * abs(at_zero):
        return 1.0
    if kinked:
        # A step at whose end at least this share of φ'(0) is left moves bodies as if rigid, against
        # friction alone, whose forces do not grow with it: it goes on until a surface resists.
        nothing_resists = 0.9
        slides = at_one <= nothing_resists * at_zero
        return _slid(slope, enough, longest()) if slides else 1.0
    return _stretched(slope, STRETCHABLE * abs(at_zero), longest())


def longest_slide(last_turn: float, strain2: float, change2: float) -> float:
    """Return how long a step may be on which bodies slide.

    Args:
        last_turn: β at which the last place turns back on it.
        strain2: ‖ε(u)‖².
        change2: The same of the step.
    """
    # It may be as long, too, as it changes strains by less than this share of them.
    share = 1e-2
    strainless = share * (strain2 / change2) ** 0.5 if change2 > 0 else 0.0
    past = 1.01  # a step goes so far beyond where the last place turns back on it
    return max(past * last_turn, strainless)


def _slid(slope: Slope, enough: float, longest: float) -> float:
    """β ≥ 1 where a surface resists that does not at 1, or as far as it may be. Collective."""
    low = 1.0
    while low < longest:
        high = min(2 * low, longest)
        if slope(high) > 0:
            return _bisected(slope, low, high, enough)
        low = high
    return longest if longest > 1 else 1.0


def _stretched(slope: Slope, enough: float, longest: float) -> float:
    """β ≥ 1 up to which the energy goes on falling much, for φ'(1) < -``enough``. Collective.

    Args:
        slope: φ'.
        enough: |φ'| where the step may end.
        longest: How long the step may be.
    """
    if longest <= 1:
        return 1.0
    return longest if slope(longest) <= 0 else _bisected(slope, 1.0, longest, enough)


def _bisected(slope: Slope, low: float, high: float, enough: float) -> float:
    """β between two, at which φ' is negative and positive, where it is zero."""
    most_bisections = 40
    for _ in range(most_bisections):
        middle = (low + high) / 2
        here = slope(middle)
        if abs(here) <= enough:
            return middle
        low, high = (middle, high) if here < 0 else (low, middle)
    return high
