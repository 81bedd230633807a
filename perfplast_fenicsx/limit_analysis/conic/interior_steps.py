"""Run the steps of the interior point method until the limit load is known."""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import TypeAlias

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.conic.conic_program import ConicProgram, Start
from perfplast_fenicsx.limit_analysis.conic.discretisation import SingularStiffness
from perfplast_fenicsx.limit_analysis.conic.interior_iteration import InteriorIteration, Unknowns

MOST_STEPS = 60

NO_LOAD = 1e-7
"""Loads and strain rates below this share of the values in a viscous flow count as zero."""

CARRIES_NONE = (
    "no stress can carry the loads: the loads move bodies away from supports without resistance"
)
"""Reason for a load factor of zero."""


class StopSearch(Exception):
    """Raised by a monitor on every rank to end the steps and keep the results.

    Attributes:
        found: Results of the search so far; None if the search had not begun.
        adapted: Results on the previous meshes of an adaptive search; None in other searches.
    """

    found: object = None
    adapted: object = None


class Verdict(StrEnum):
    """The outcome of a search for a limit load."""

    FOUND = "found"
    UNBOUNDED = "unbounded"
    NO_RESISTANCE = "no resistance"
    STALLED = "stalled"


@dataclass(frozen=True)
class InteriorStep:
    """One step of the interior point method.

    Attributes:
        number: Number of the step, from 1.
        load: Load factor λ of the stress, a lower bound once the forces are in balance.
        gap: Kinematic minus static load for an admissible velocity, relative to the power of all
            loads.
        unbalanced: Largest unbalanced force, relative to the largest load.
        inadmissible: Volume change of v in plastic bodies and strain rate in elastic bodies,
            relative to ‖ε(v)‖.
        length: Length of the step, at most 1.
        seconds: Wall time since the start of the search.
    """

    number: int
    load: float
    gap: float
    unbalanced: float
    inadmissible: float
    length: float
    seconds: float


Monitor: TypeAlias = Callable[[InteriorStep], None]
"""Called on every rank after each step."""


def carries_none(program: ConicProgram, most: float, rate: float) -> bool:
    """Return whether the load factor is zero because bodies move without resistance.

    Args:
        program: The program with the loads.
        most: Upper bound of the power of the loads.
        rate: Root mean square of the strain rates.
    """
    small = most <= NO_LOAD * program.degree and rate <= NO_LOAD
    return small and not program.has_dead


def iterate(
    iteration: InteriorIteration,
    rtol: float,
    steps: list[InteriorStep],
    monitor: Monitor | None,
    share: float = 1.0,
    least: float = 0.0,
) -> tuple[Verdict, str]:
    """Perform steps until the limit load is known. Collective.

    To first order, unbalanced forces r change λ by r·v, where v is the mechanism with L(v) = 1. The
    caller removes these residuals afterwards; with residuals, λ is not a bound.

    Args:
        iteration: The iteration at its start.
        rtol: Largest relative difference of static and kinematic load.
        steps: List to which the steps are appended.
        monitor: Called on every rank after each step.
        share: Share of the tolerance that the solution may use.
        least: Load factor up to which the function does not report an unbounded load.
    """
    program, began = iteration.program, time.perf_counter()
    good: tuple[Unknowns, Floats] | None = None  # last balanced iterate and its velocity's entries
    # Without a sign of a mechanism, this many times the viscous flow's load counts as unbounded.
    unbounded = 50.0
    far = unbounded * (program.degree + program.dead_to_live())
    far = max(far, least / program.load_unit)
    # Largest unbalanced force and missing work that the bounds can remove afterwards.
    least_residual = 1e-5
    # Largest unbalanced force, relative to the largest load, if such forces do almost no work. For
    # a body force on fine cells it is far below the rounding of the internal forces. A velocity
    # whose inadmissible part exceeds this number is far from a mechanism.
    almost = 1e-3
    stuck = 1e-6  # length of a step that counts as zero
    while len(steps) < MOST_STEPS:
        try:
            length = iteration.step()
        except SingularStiffness as failure:
            return Verdict.STALLED, str(failure)
        if length < stuck:
            return Verdict.STALLED, "the steps became too short"
        load, gap, size = iteration.now.load, iteration.gap(), iteration.size()
        unbalanced, missing = iteration.unbalanced(), iteration.missing_work()
        wrong, rate = iteration.rates()
        inadmissible = wrong / rate if rate > 0 else 0.0
        step = InteriorStep(
            number=len(steps) + 1,
            load=load * program.load_unit,
            gap=gap / size if size else np.inf,
            unbalanced=unbalanced,
            inadmissible=inadmissible,
            length=length,
            seconds=time.perf_counter() - began,
        )
        steps.append(step)
        if monitor is not None:
            monitor(step)
        if load > far and unbalanced <= almost < inadmissible:
            return Verdict.UNBOUNDED, (
                "stresses within yield carry the loads beyond ζ ="
                f" {far * program.load_unit:.3g}, so the loads seem to have no limit"
            )
        at_rest = rate <= NO_LOAD  # bodies move rigidly, and strain rates are rounding errors
        tolerated = share * rtol * size
        idle = unbalanced <= almost and abs(iteration.unbalanced_work()) <= tolerated
        balanced = missing <= least_residual and unbalanced <= least_residual
        if good is not None and not balanced:  # rounding errors of a nearly singular K
            iteration.now, iteration.velocity.array[:] = good
            return Verdict.FOUND, f"the steps have converged to {rtol:g}"
        settled = missing <= least_residual and (unbalanced <= least_residual or idle)
        if not settled or (inadmissible > almost and not at_rest):
            continue
        if carries_none(program, size + gap, rate):
            return Verdict.NO_RESISTANCE, CARRIES_NONE
        if gap <= tolerated:
            return Verdict.FOUND, f"the steps have converged to {rtol:g}"
        if balanced and gap <= rtol * size:
            good = iteration.kept()
    return Verdict.STALLED, f"the bounds have not met in {MOST_STEPS} steps"


def next_start(
    start: Start, program: ConicProgram, now: Unknowns | None, verdict: Verdict, rtol: float
) -> Start | None:
    """Return the start of the next search; None if none is needed or possible.

    Collective.

    Args:
        start: Start of the last search.
        program: Program of the last search.
        now: Final iterate; None if the search has not begun.
        verdict: Outcome of the search.
        rtol: Relative excess over yield that is allowed.
    """
    if verdict is Verdict.UNBOUNDED and now is not None and program.num_pairs and not start.pushed:
        return replace(start, pushed=True)
    over = False
    if now is not None:
        whole = program.whole(now.stress, now.load)
        over = program.overstress(whole) > 1 + rtol
    if verdict is Verdict.NO_RESISTANCE or (verdict is Verdict.FOUND and not over):
        return None
    stronger = program.stronger()
    return None if stronger is None else replace(start, scale=stronger, pushed=False)
