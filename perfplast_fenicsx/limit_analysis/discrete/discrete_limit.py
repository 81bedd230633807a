"""Compute the limit load of the discrete problem by an interior point method, without a path.

Static and kinematic limit load converge to each other in 5 to 30 factorisations, for any mesh. The
bounds are those of the *discrete* problem: equilibrium of the finite elements, with yield and
dissipation at the quadrature points.
"""

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace

import numpy as np

from perfplast_fenicsx.limit_analysis.conic.conic_program import UNLIMITED, Start, choose_units
from perfplast_fenicsx.limit_analysis.conic.conic_solver import chosen_conic
from perfplast_fenicsx.limit_analysis.conic.discretisation import SingularStiffness
from perfplast_fenicsx.limit_analysis.conic.interior_iteration import InteriorIteration
from perfplast_fenicsx.limit_analysis.conic.interior_steps import (
    InteriorStep,
    StopSearch,
    Verdict,
    next_start,
)
from perfplast_fenicsx.limit_analysis.discrete.discrete_bounds import IN_BALANCE
from perfplast_fenicsx.limit_analysis.discrete.discrete_result import (
    discrete_result,
    why_unbounded,
)
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitLoad
from perfplast_fenicsx.limit_analysis.discrete.limit_program import limit_program
from perfplast_fenicsx.limit_analysis.statements.limit_checks import (
    check_bodies_have_limits,
    check_friction_has_limits,
    check_loads,
    check_tolerance,
)
from perfplast_fenicsx.limit_analysis.statements.question import Question
from perfplast_fenicsx.limit_analysis.statements.standing import Standing
from perfplast_fenicsx.problem.problem import Problem


def interior_point(
    problem: Problem, rtol: float = 1e-4, monitor: Callable[[InteriorStep], None] | None = None
) -> LimitLoad:
    """Compute the discrete limit load, its mechanism and its stress. Collective.

    Args:
        problem: The bodies and their loads.
        rtol: Largest relative difference of the bounds.
        monitor: Called on every rank after each step.

    Raises:
        InputError: If ``rtol`` is not between 0 and 1, supports move, there are no loads, or the
            method does not support a body's yield set (:mod:`body_cones`).
    """
    check_bodies_have_limits(problem)
    check_tolerance(rtol)
    check_loads(problem)
    check_friction_has_limits(problem)
    if not problem.loads.grows():
        return _of_dead_loads(_searched(problem, rtol, monitor, Question.STANDS))
    try:
        found = _searched(problem, rtol, monitor, Question.LIMIT)
    except StopSearch as stop:
        if isinstance(stop.found, LimitLoad):
            stop.found = _or_none(problem, stop.found)
        raise
    unknown = found.verdict is Verdict.STALLED and not np.isfinite(found.lower)
    if not problem.loads.has_dead() or not unknown:
        return _or_none(problem, found)
    return _with_standing(found, _searched(problem, rtol, monitor, Question.STANDS))


def _or_none(problem: Problem, found: LimitLoad) -> LimitLoad:
    """Return the result with a lower bound of at least 0 if there are no permanent loads."""
    return found if problem.loads.has_dead() else replace(found, lower=max(found.lower, 0.0))


def _searched(
    problem: Problem,
    rtol: float,
    monitor: Callable[[InteriorStep], None] | None,
    question: Question,
) -> LimitLoad:
    """Search, and start again as long as that may improve the result. Collective."""
    found, start = _search(problem, rtol, monitor, Start.within(rtol), question)
    while start is not None:
        before = found
        found, start = _search(problem, rtol, monitor, start, question)
        found = _together(before, found)
    return found


def _with_standing(found: LimitLoad, stands: LimitLoad) -> LimitLoad:
    """Return the result together with the share of the permanent loads that is carried."""
    told = _of_dead_loads(stands)
    standing = told.standing
    if standing is not None and not standing.falls:
        reason = f"{found.reason}; {standing.in_words()}"
        told = replace(found, standing=standing, reason=reason)
    return _of_both(told, found, stands)


def _of_dead_loads(stands: LimitLoad) -> LimitLoad:
    """Return the result as a multiple of the permanent loads, without a load factor."""
    times = stands.lower if np.isfinite(stands.lower) else None
    standing = Standing(times, stands.upper)
    return replace(
        stands,
        reason=standing.in_words() if stands.verdict is Verdict.FOUND else stands.reason,
        lower=-np.inf,
        estimate=None,
        upper=None,
        question=Question.STANDS,
        standing=standing,
    )


def _together(before: LimitLoad, after: LimitLoad) -> LimitLoad:
    """Return the better of two results, with the iterations of both searches."""
    worse = after.verdict is not Verdict.FOUND and after.upper is None
    return _of_both(before if worse and before.upper is not None else after, before, after)


def _of_both(told: LimitLoad, before: LimitLoad, after: LimitLoad) -> LimitLoad:
    """Return a result with the effort of both searches."""
    steps = [*before.steps, *after.steps]
    return replace(
        told,
        steps=steps,
        iterations=len(steps),
        factorisations=(before.factorisations or 0) + (after.factorisations or 0),
        linear_solves=before.linear_solves + after.linear_solves,
    )


def _search(
    problem: Problem,
    rtol: float,
    monitor: Callable[[InteriorStep], None] | None,
    start: Start,
    question: Question,
) -> tuple[LimitLoad, Start | None]:
    """Search from a start; return the result and the next start, None to end. Collective."""
    with ExitStack() as made:
        program = limit_program(problem, question, start.reserve)
        made.callback(program.destroy)
        steps: list[InteriorStep] = []
        if program.degree == program.num_pairs:
            reason = (
                "nothing can yield; give the bodies that may collapse a yield stress, or ask for"
                " bounds of blocks that collapse by their joints (control = 'bounds')"
            )
            return discrete_result(
                problem, program, None, Verdict.UNBOUNDED, reason, steps, rtol, question
            ), None
        try:
            limited = choose_units(program, start)
        except SingularStiffness as failure:
            found = discrete_result(
                problem, program, None, Verdict.STALLED, str(failure), steps, rtol, question
            )
            return found, next_start(start, program, None, Verdict.STALLED, rtol)
        if not limited:
            reason = UNLIMITED
            if problem.degree == 1:
                reason += (
                    "; this also seems so where linear elements lock: use quadratic ones (degree ="
                    " 2 under [element])"
                )
            found = discrete_result(
                problem, program, None, Verdict.UNBOUNDED, reason, steps, rtol, question
            )
            return found, next_start(start, program, None, Verdict.UNBOUNDED, rtol)
        iteration = InteriorIteration(program)
        made.callback(iteration.destroy)
        # The steps end at this share of rtol: making the mechanism exactly admissible afterwards
        # raises the upper bound, and this leaves room for it.
        closer = 0.1
        try:
            verdict, reason = chosen_conic()(
                iteration, rtol, steps, monitor, closer, question.enough
            )
        except StopSearch as stop:
            reason = f"the search was stopped after {len(steps)} steps"
            verdict = Verdict.STALLED
            stop.found = discrete_result(
                problem, program, iteration, verdict, reason, steps, rtol, question
            )
            raise
        if verdict is Verdict.UNBOUNDED:
            reason += f": {why_unbounded(problem)}"
        then = next_start(start, program, iteration.now, verdict, rtol)
        found = discrete_result(problem, program, iteration, verdict, reason, steps, rtol, question)
        over = not np.isfinite(found.lower) and found.unbalanced <= IN_BALANCE
        if program.keeps and verdict is Verdict.FOUND and over:
            then = start.with_more_in_reserve()
        return found, then
