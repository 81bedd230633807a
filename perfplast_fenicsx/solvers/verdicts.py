"""Why a level ends without a solution, in words."""

from collections.abc import Sequence

from perfplast_fenicsx.problem.judged.report import Iteration

BEYOND = 1e3
"""J_ζ counts as unbounded below where it still falls at so many times the first step's work."""

CREDIBLE = 1e-2
"""A state with a larger duality gap is no solution, whatever the steps to it were."""

SLIDES = 1e-6
"""Where surfaces rub, a larger duality gap, or force of friction beyond its bound, does not come
from steps that were too coarse. Bodies slide on, and steps that are nearly rigid motions look
small. Levels with a coarser tolerance may have ten times that."""


def above_limit(zeta: float, history: Sequence[Iteration], grows: bool = True) -> str:
    """Return the verdict that (P)_ζ has no solution, with its evidence.

    Args:
        zeta: Load factor.
        history: The steps so far.
        grows: Whether ζ multiplies any load.
    """
    first, last = history[0], history[-1]
    if zeta == 0 or not grows:
        return (
            f"the constant loads alone are above what the bodies carry: at ζ = {zeta:.9g} J fell"
            f" from {first.energy:.4g} to {last.energy:.4g}, and falls on along a collapse"
            f" mechanism beyond {BEYOND:g} times the work of the first step"
        )
    side = "above the limit load" if zeta > 0 else "below the lower limit load"
    return (
        f"no equilibrium exists at ζ = {zeta:.9g}, it is {side}: J_ζ fell from"
        f" {first.energy:.4g} to {last.energy:.4g} while the work of the loads grew from"
        f" {first.alpha:.4g} to {last.alpha:.4g}, and falls on along a collapse mechanism beyond"
        f" {BEYOND:g} times the first"
    )


def not_credible(duality_gap: float) -> str:
    """Return the verdict on an end of the steps at a state that is no solution."""
    return (
        f"the steps have become small at a state that is no solution (duality gap"
        f" {duality_gap:.2g}), as where bodies lose all contact"
    )


def slides_on(unbalanced: float, duality_gap: float) -> str:
    """Return the verdict on an end of the steps where surfaces still slide."""
    return (
        "the steps have become small while bodies slide on: friction is out of balance by"
        f" {unbalanced:.2g} of the largest force between surfaces (duality gap {duality_gap:.2g}),"
        " as where it is overcome and a body slides as a whole"
    )


def no_convergence(max_iterations: int, called: str, history: Sequence[Iteration]) -> str:
    """Return the verdict on a level that has used up its iterations.

    Args:
        max_iterations: So many.
        called: What they are called.
        history: The steps.
    """
    told = f"no convergence in {max_iterations} {called}"
    first, last = abs(history[0].alpha), abs(history[-1].alpha)
    if not last > BEYOND * first > 0:
        return told
    return (
        f"{told}, in which the work of the loads has grown from {first:.4g} to {last:.4g}, as it"
        " does above the limit load; but no collapse mechanism has shown that it is"
    )
