"""Choose the next step in α of a loading by chosen steps.

α grows by a factor that decreases where ζ(α) bends or a level needs many steps, and increases on
the plateau, where a collapse mechanism may allow a longer step. Closing gaps end a step: a body
that has reached its own limit load has a plateau too, until another body supports it.
"""

import math
from dataclasses import dataclass

from dolfinx import fem

from perfplast_fenicsx.problem.judged.state import State
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.solvers.closing import closing_work, has_closed

LARGEST_FACTOR = 4.0
"""Largest growth of α from one level to the next."""


SMALLEST_FACTOR = 1.2
"""Growth of α after levels with many steps."""


@dataclass(frozen=True)
class Reached:
    """Progress of a loading by chosen steps: all data for the next step.

    Attributes:
        last: State of the last level.
        before: State of the level before it; None after the first one.
        newton_iterations: Number of steps of the last level.
        rest: α at ζ = 0, if other loads than ζ act on the bodies.
    """

    last: State
    before: State | None
    newton_iterations: int
    rest: float = 0.0


@dataclass(frozen=True)
class Leap:
    """A step of any length along a velocity at constant load.

    Attributes:
        alpha: The target work.
        velocity: v with L(v) = 1.
    """

    alpha: float
    velocity: fem.Function


def next_work(
    problem: Problem, reached: Reached, leap: Leap | None
) -> tuple[float, State | None, Leap | None]:
    """Return the work of the next level, and its start. Collective.

    Args:
        problem: The problem that is loaded.
        reached: Progress of the loading.
        leap: The suggestion of a mechanism, if there is one.

    Returns:
        α; the earlier of two states that define the line to the start, or the last state for no
        line; and the leap, if it is taken.
    """
    last, before, rest = reached.last, reached.before, reached.rest
    if before is not None and has_closed(problem, before, last):
        return rest + (last.alpha - rest) * SMALLEST_FACTOR, last, None
    if leap is not None:
        alpha = leap.alpha
    else:
        alpha = rest + (last.alpha - rest) * _next_factor(reached)
    if before is None:
        return alpha, before, leap
    event = closing_work(problem, before, last, alpha)
    # Least growth of α to a closing gap, so that nearly closed pairs do not stop the path.
    least_factor = 1.02
    event = max(event, min(alpha, rest + (last.alpha - rest) * least_factor))
    return event, before, leap if event >= alpha else None


def _next_factor(reached: Reached) -> float:
    last, before = reached.last, reached.before
    first_factor = 3.0  # growth of α after first yield, and largest growth where ζ(α) bends
    if before is None or before.alpha <= reached.rest:
        return first_factor
    factor = (last.alpha - reached.rest) / (before.alpha - reached.rest)
    bend = 1 - before.zeta / last.zeta if last.zeta > 0 else 1.0
    many_iterations = 20  # levels with more Newton steps reduce the next growth
    if reached.newton_iterations > many_iterations:
        return max(math.sqrt(factor), SMALLEST_FACTOR)
    # Growth of ζ in a level above which steps in α decrease, and below which they increase.
    bent, straight = 0.08, 0.02
    if bend > bent:
        return max(min(factor, first_factor), SMALLEST_FACTOR)
    return min(factor * (2.0 if bend < straight else 1.2), LARGEST_FACTOR)
