"""Explain in words why a level ends without a solution; import neither MPI nor DOLFINx."""

from collections.abc import Sequence

from perfplast_fenicsx.problem.judged.report import Iteration

BEYOND = 1e3
"""J_ζ counts as unbounded below if it still falls at this multiple of the work in the first
step."""

CREDIBLE = 1e-2
"""A state with a larger duality gap is not a solution, whatever the size of the last steps."""

SLIDES = 1e-6
"""With friction, a larger duality gap or a larger imbalance of friction is not due to inaccurate
steps: bodies continue to slide, with small steps that are nearly rigid motions. For levels with a
coarse tolerance, the limit is ten times this tolerance if that is larger."""


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
            f"the bodies cannot carry the constant loads alone: at ζ = {zeta:.9g}, the energy J "
            f"fell from {first.energy:.4g} to {last.energy:.4g}, and it falls further along a "
            f"collapse mechanism beyond {BEYOND:g} times the work of the first step"
        )
    side = "above the limit load" if zeta > 0 else "below the lower limit load"
    return (
        f"no equilibrium exists at ζ = {zeta:.9g}, which is {side}: the energy J_ζ fell from "
        f"{first.energy:.4g} to {last.energy:.4g} while the work of the loads grew from "
        f"{first.alpha:.4g} to {last.alpha:.4g}, and J_ζ falls further along a collapse mechanism "
        f"beyond {BEYOND:g} times the work of the first step"
    )


def not_credible(duality_gap: float) -> str:
    """Return the verdict on steps that became small at a state that is not a solution."""
    return (
        f"the steps became small at a state that is not a solution (duality gap"
        f" {duality_gap:.2g}); bodies may have lost all contact"
    )


def slides_on(unbalanced: float, duality_gap: float) -> str:
    """Return the verdict on steps that became small while surfaces still slide."""
    return (
        "the steps became small while bodies continue to slide: friction is out of balance by"
        f" {unbalanced:.2g} of the largest force between surfaces (duality gap {duality_gap:.2g});"
        " a body may slide as a whole because its friction is overcome"
    )


def no_convergence(max_iterations: int, called: str, history: Sequence[Iteration]) -> str:
    """Return the verdict on a level that has used all its iterations.

    Args:
        max_iterations: Largest number of iterations.
        called: Name of the iterations in messages.
        history: The steps of the level.
    """
    told = f"no convergence in {max_iterations} {called}"
    first, last = abs(history[0].alpha), abs(history[-1].alpha)
    if not last > BEYOND * first > 0:
        return told
    return (
        f"{told}, while the work of the loads grew from {first:.4g} to {last:.4g}; this "
        "suggests a load above the limit load, but no collapse mechanism proves it"
    )
