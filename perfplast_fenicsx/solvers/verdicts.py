"""Why a level ends without a solution, in words."""

from collections.abc import Sequence

from perfplast_fenicsx.problem.report import Iteration

BEYOND = 1e3
"""J_ζ counts as unbounded below where it still falls at so many times the first step's work."""

CREDIBLE = 1e-2
"""A state with a larger duality gap is no solution, whatever the steps to it were."""


def above_limit(zeta: float, history: Sequence[Iteration], grows: bool = True) -> str:
    """The verdict that (P)_ζ has no solution, with its evidence.

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
    """The verdict on an end of the steps at a state that is no solution."""
    return (
        f"the steps have become small at a state that is no solution (duality gap"
        f" {duality_gap:.2g}), as where bodies lose all contact"
    )


def no_convergence(max_iterations: int, called: str) -> str:
    """The verdict on a level that has used up its iterations."""
    return f"no convergence in {max_iterations} {called}"
