"""How far a loading by chosen steps in α goes next.

α grows by a factor that shrinks where ζ(α) bends or a level has needed many steps, and grows on the
plateau, where a collapse mechanism may show farther ahead. Gaps that close end a step: a body that
has reached a limit load of its own has a plateau, too, until another one helps it.
"""

import math
from dataclasses import dataclass

from dolfinx import fem

from perfplast_fenicsx.problem.judged.state import State
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.solvers.closing import closing_work, has_closed

LARGEST_FACTOR = 4.0
"""α grows at most so much from one level to the next."""


SMALLEST_FACTOR = 1.2
"""Growth of α after levels that were hard to solve."""


@dataclass(frozen=True)
class Reached:
    """How far a loading by chosen steps has come: all that its next step depends on.

    Attributes:
        last: State of the last level.
        before: State of the level before it; None after the first one.
        newton_iterations: Steps that the last level took.
        rest: α at ζ = 0, where something else than ζ loads the bodies.
    """

    last: State
    before: State | None
    newton_iterations: int
    rest: float = 0.0


@dataclass(frozen=True)
class Leap:
    """A step as far as one likes, along a velocity that costs no more load.

    Attributes:
        alpha: The work to be reached.
        velocity: v with L(v) = 1.
    """

    alpha: float
    velocity: fem.Function


def next_work(
    problem: Problem, reached: Reached, leap: Leap | None
) -> tuple[float, State | None, Leap | None]:
    """Return the work of the next level, and what it starts from. Collective.

    Args:
        problem: The problem that is loaded.
        reached: How far it has come.
        leap: What a mechanism suggests, if there is one.

    Returns:
        α; the earlier one of two states through which the line to the start goes, or the last one
        for none; and the leap, where it is taken.
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
    # Growth of α up to where a gap closes, lest pairs that are all but closed hold it up.
    least_factor = 1.02
    event = max(event, min(alpha, rest + (last.alpha - rest) * least_factor))
    return event, before, leap if event >= alpha else None


def _next_factor(reached: Reached) -> float:
    last, before = reached.last, reached.before
    first_factor = 3.0  # growth of α after first yield, and the most where ζ(α) bends
    if before is None or before.alpha <= reached.rest:
        return first_factor
    factor = (last.alpha - reached.rest) / (before.alpha - reached.rest)
    bend = 1 - before.zeta / last.zeta if last.zeta > 0 else 1.0
    many_iterations = 20  # levels that need more Newton steps make the next growth smaller
    if reached.newton_iterations > many_iterations:
        return max(math.sqrt(factor), SMALLEST_FACTOR)
    # Growth of ζ in a level above which steps in α shrink, and below which they grow.
    bent, straight = 0.08, 0.02
    if bend > bent:
        return max(min(factor, first_factor), SMALLEST_FACTOR)
    return min(factor * (2.0 if bend < straight else 1.2), LARGEST_FACTOR)
