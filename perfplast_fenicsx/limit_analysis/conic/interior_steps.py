"""Steps of the interior point method until it is known what the limit load is."""

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
"""A load below this share of that of a viscous flow is zero, and so is a strain rate."""

CARRIES_NONE = (
    "no stress can carry the loads: they move bodies off what holds them, and meet no resistance"
)
"""Reason where a load factor is zero."""


class StopSearch(Exception):
    """Raised by a monitor, on every rank alike, to end the steps and keep the results.

    Attributes:
        found: What the search has found so far; None if it had not begun.
        adapted: What meshes before have given, where there are several; else None.
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
    """One step of the method.

    Attributes:
        number: From 1.
        load: λ of the stress, a lower bound once forces balance.
        gap: What λ of the velocity exceeds it by, once that is admissible, relative to the power of
            all loads there.
        unbalanced: Largest force that nothing balances, relative to the largest of the loads.
        inadmissible: Volume change of v in plastic bodies, and strain in elastic ones, relative to
            ‖ε(v)‖.
        length: Length of the step, at most 1.
        seconds: Wall time so far.
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
    """Return whether a load factor is zero, as bodies move without resistance.

    Args:
        program: Of the loads.
        most: What the power of the loads is at most.
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
    """Step until it is known what the limit load is. Collective.

    Forces without balance r change λ by r·v to first order, v being the mechanism with L(v) = 1.
    Their residuals are removed afterwards, or there is no bound.

    Args:
        iteration: At its start.
        rtol: Largest difference of static and kinematic load, relative.
        steps: To which the steps are added.
        monitor: Called on every rank after each step.
        share: Share of the tolerance that the steps may leave.
        least: Load factor up to which a load is not taken for one without a bound.
    """
    program, began = iteration.program, time.perf_counter()
    good: tuple[Unknowns, Floats] | None = None  # an iterate and its velocity's entries
    # A load so many times that of a viscous flow, without any mechanism in sight, has no bound.
    unbounded = 50.0
    far = unbounded * (program.degree + program.dead_to_live())
    far = max(far, least / program.load_unit)
    # Forces without balance, and work that is missing, that the bounds then do away with.
    least_residual = 1e-5
    # Forces without balance that may be left where they do next to no work on the
    # mechanism, relative to the largest load: of a body force that is spread thin over
    # fine cells this is far below the rounding of the forces inside. A velocity that is
    # less admissible is far from a mechanism.
    almost = 1e-3
    stuck = 1e-6  # length of a step that counts as none
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
                f" {far * program.load_unit:.3g}, so that nothing seems to bound them"
            )
        at_rest = rate <= NO_LOAD  # bodies move as rigid ones, and what strains is rounding
        tolerated = share * rtol * size
        idle = unbalanced <= almost and abs(iteration.unbalanced_work()) <= tolerated
        balanced = missing <= least_residual and unbalanced <= least_residual
        if good is not None and not balanced:  # rounding of a K that is nearly singular
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
            good = iteration.now, iteration.velocity.array_r.copy()
    return Verdict.STALLED, f"the bounds have not met in {MOST_STEPS} steps"


def next_start(
    start: Start, program: ConicProgram, now: Unknowns | None, verdict: Verdict, rtol: float
) -> Start | None:
    """Return the next start if a search has not found what is sought; None to end. Collective.

    Args:
        start: Where it began.
        program: That of the search.
        now: Where it ended; None if it has not begun.
        verdict: What came of it.
        rtol: By how much stress may exceed yield that was found.
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
