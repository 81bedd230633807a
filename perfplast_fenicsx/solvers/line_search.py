"""Find the length of a Newton step, at which the derivative of the energy along it vanishes.

The energy is convex, so that its derivative φ'(β) is nondecreasing and bisection finds the zero.
"""

from collections.abc import Callable

Slope = Callable[[float], float]
"""The derivative φ'(β); collective."""

SLOPE_REDUCTION = 1e-3
"""A shortened step ends where |φ'(β)| is at most this share of |φ'(0)|."""


LONGEST = 1.5
"""Largest length of a stretched step; twice the length is too far where bodies bend."""

STRETCHABLE = 0.1
"""A step is stretched if at least this share of φ'(0) is left at its end, and until less is left.
The yielded zone grows from step to step, so that each step is too short."""


def step_length(
    slope: Slope,
    noise: Callable[[], tuple[float, float]],
    longest: Callable[[], float] | None = None,
    kinked: bool = False,
) -> float:
    """Return β = argmin of the energy over (0, 1], or to ``longest`` if it still falls much at 1.

    β = 1 is accepted if φ' is not positive there, or so small relative to φ'(0) or its terms that a
    shorter step gains nothing. Collective.

    Args:
        slope: φ'.
        noise: Rounding errors of φ' as a sum, and including those of its terms; called only if they
            decide.
        longest: Largest step length; None for 1.
        kinked: Whether the energy has kinks that the step may not account for. If it rises from the
            start, β = 0, and the next step has better information.
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
        # A step with at least this share of φ'(0) left at its end moves bodies as if rigid, against
        # friction only, whose forces are constant: it continues until a surface resists.
        nothing_resists = 0.9
        slides = at_one <= nothing_resists * at_zero
        return _slid(slope, enough, longest()) if slides else 1.0
    return _stretched(slope, STRETCHABLE * abs(at_zero), longest())


def longest_slide(last_turn: float, strain2: float, change2: float) -> float:
    """Return the largest length of a step on which bodies slide.

    Args:
        last_turn: β at which the last place reverses its slip.
        strain2: ‖ε(u)‖².
        change2: ‖ε(δu)‖² of the step.
    """
    # It may also be so long that it changes strains by less than this share.
    share = 1e-2
    strainless = share * (strain2 / change2) ** 0.5 if change2 > 0 else 0.0
    past = 1.01  # factor beyond the β at which the last place reverses its slip
    return max(past * last_turn, strainless)


def _slid(slope: Slope, enough: float, longest: float) -> float:
    """Return a β ≥ 1 at which another surface resists, or the largest allowed one. Collective."""
    low = 1.0
    while low < longest:
        high = min(2 * low, longest)
        if slope(high) > 0:
            return _bisected(slope, low, high, enough)
        low = high
    return longest if longest > 1 else 1.0


def _stretched(slope: Slope, enough: float, longest: float) -> float:
    """Return the β ≥ 1 up to which the energy still falls much, for φ'(1) < -``enough``.

    Collective.

    Args:
        slope: φ'.
        enough: |φ'| at which the step may end.
        longest: Largest step length.
    """
    if longest <= 1:
        return 1.0
    return longest if slope(longest) <= 0 else _bisected(slope, 1.0, longest, enough)


def _bisected(slope: Slope, low: float, high: float, enough: float) -> float:
    """Return the β of the zero between two, at which φ' is negative and positive."""
    most_bisections = 40
    for _ in range(most_bisections):
        middle = (low + high) / 2
        here = slope(middle)
        if abs(here) <= enough:
            return middle
        low, high = (middle, high) if here < 0 else (low, middle)
    return high
