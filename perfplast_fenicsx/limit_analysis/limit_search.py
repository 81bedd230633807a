"""Compute the limit load ζ_lim where ζ(α) levels off, with both sides and the collapse mechanism.

ζ(α) is continuous, does not fall, and tends to ζ_lim as α grows (properties iii and v of Čermák,
Haslinger, Sysala, COMPLAS XII, 2013). So every ζ(α) reached is a static side of the discrete limit
load. Where the curve is nearly flat, its increments are nearly a mechanism. The mechanism gives a
kinematic side, and the direction of the next leap, until both sides meet. No side bounds the body.
"""

import logging
from collections.abc import Callable
from typing import Any

from perfplast_fenicsx.errors import InputError, nearest
from perfplast_fenicsx.limit_analysis.coulomb_search import check_resolution, coulomb_limit
from perfplast_fenicsx.limit_analysis.discrete.body_cones import body_cones
from perfplast_fenicsx.limit_analysis.discrete.discrete_limit import interior_point
from perfplast_fenicsx.limit_analysis.discrete.limit_load import (
    TOLERANCE,
    LimitLoad,
    LimitMethod,
    method_for,
    resisted,
)
from perfplast_fenicsx.limit_analysis.path.limit_judge import Judge, Search, collapse_mechanism
from perfplast_fenicsx.limit_analysis.statements.limit_checks import (
    check_bodies_have_limits,
    check_friction_has_limits,
    check_loads,
    check_tolerance,
)
from perfplast_fenicsx.problem.judged.state import Level
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.solvers.linear.factorisation import TooLarge
from perfplast_fenicsx.solvers.load_stepping import Reached, work_path
from perfplast_fenicsx.solvers.newton import WorkNewton
from perfplast_fenicsx.solvers.newton_options import NewtonOptions

log = logging.getLogger(__name__)


def limit_load(
    problem: Problem,
    rtol: float = TOLERANCE,
    solver: WorkNewton | None = None,
    *,
    method: LimitMethod | str | None = None,
    monitor: Callable[[Any], None] | None = None,
    on_level: Callable[[Level, Search], None] | None = None,
    search: Search | None = None,
    reached: Reached | None = None,
) -> LimitLoad:
    """Return the limit load of the mesh, with its bounds and its mechanism. Collective.

    The interior point method (:func:`discrete_limit.interior_point`) finds both bounds in 10 to 20
    factorisations. A loading by work also gives the curve, and continues until ζ(α) has levelled
    off. With Coulomb's friction no limit theorem holds; the result is then the load at which the
    path loses equilibrium (:func:`coulomb_search.coulomb_limit`).

    Args:
        problem: The bodies and their loads.
        rtol: Relative distance of the bounds. For a path whose laws give no mechanism: relative
            difference of the estimate from ζ, and from the estimate of the level before.
        solver: ALG3 or ALG4 for a path; the default is ALG3 with :func:`limit_options`.
        method: "interior-point" or "path". The default is the interior point method, if it knows
            the laws, a factorisation fits, and no argument of a path is given. If it does not fit
            after all, a path follows.
        monitor: Called on every rank after each iteration.
        on_level: Called on every rank after each level, with the result so far.
        search: State of an earlier search, to continue it.
        reached: Point that the earlier search had reached.

    Raises:
        InputError: If ``rtol`` is not between 0 and 1, or too small to distinguish sliding from
            rest with Coulomb's friction. If all loads are constant, bodies harden, or no stress can
            carry the loads. If the interior point method is requested for a problem that it does
            not know.
    """
    check_tolerance(rtol)
    check_bodies_have_limits(problem)
    follows = any(given is not None for given in (solver, on_level, search, reached))
    if problem.friction.follows_pressure and method != LimitMethod.INTERIOR_POINT:
        if method is not None:
            _chosen(method, problem, follows)
        solver = solver or WorkNewton(problem, NewtonOptions(**limit_options(rtol, coulomb=True)))
        return coulomb_limit(problem, rtol, solver, monitor, on_level, search, reached)
    check_friction_has_limits(problem)
    if _chosen(method, problem, follows) is LimitMethod.INTERIOR_POINT:
        try:
            return resisted(interior_point(problem, rtol, monitor))
        except TooLarge as fault:
            if method is not None:
                raise InputError(
                    f"{str(fault).removesuffix('.')}; limit_method = 'path' needs no factorisation."
                ) from fault
            log.info("%s A loading path follows, which needs no factorisation.", fault)
    solver = solver or WorkNewton(problem, NewtonOptions(**limit_options(rtol)))
    return _by_path(problem, rtol, solver, monitor, on_level, search or Search(), reached)


def _by_path(
    problem: Problem,
    rtol: float,
    solver: WorkNewton,
    monitor: Callable[[Any], None] | None,
    on_level: Callable[[Level, Search], None] | None,
    search: Search,
    reached: Reached | None,
) -> LimitLoad:
    """Follow a loading path until the load levels off; see :func:`limit_load`. Collective."""
    judge = Judge(problem, rtol, search)
    first = search.linear_solves - solver.linear.solves
    levels: list[Level] = []
    last, before = (reached.last, reached.before) if reached else (None, None)
    for level in () if search.ended else work_path(solver, monitor, reached, judge.ahead):
        if level.report.converged:
            levels.append(level)
            before, last = last, level.state
            judge(last, before, level.report.plastic_cells)
        else:
            judge.stop(before, last, level.report.reason)
        search.linear_solves = first + solver.linear.solves + judge.solves
        if on_level is not None:
            on_level(level, search)
        if search.ended:
            break
    judge.destroy()
    estimates = search.estimates
    known = bool(estimates) and (search.levelled_off or search.upper is not None)
    return LimitLoad(
        method=LimitMethod.PATH,
        lower=search.lower,
        estimate=estimates[-1] if known else None,
        residual=abs(1 - estimates[-2] / estimates[-1]) if len(estimates) > 1 else None,
        upper=search.upper,
        alpha=(search.rest or 0.0) + (search.points[-1][0] if search.points else 0.0),
        levelled_off=search.levelled_off,
        reason=search.reason,
        iterations=len(search.points) + (search.rest is not None),
        linear_solves=search.linear_solves,
        factorisations=None,
        mechanism=judge.mechanism or collapse_mechanism(problem, before, last),
        levels=levels,
    )


def check_limit_load(problem: Problem, rtol: float, solver: WorkNewton | None) -> None:
    """Refuse problems that :func:`limit_load` would refuse, without solving. Collective.

    Args:
        problem: The bodies and their loads.
        rtol: Relative difference of the bounds at which the search ends.
        solver: Solver of a path; None for the interior point method.

    Raises:
        InputError: As :func:`limit_load`, except for loads that no stress can carry.
    """
    check_tolerance(rtol)
    check_bodies_have_limits(problem)
    if solver is not None and problem.friction.follows_pressure:
        check_resolution(rtol, solver)
        return
    check_friction_has_limits(problem)
    if solver is None:
        check_loads(problem)
        body_cones(problem)


def _chosen(method: str | None, problem: Problem, follows: bool) -> LimitMethod:
    """Return the requested method, or the one that suits the problem."""
    if method is None:
        return LimitMethod.PATH if follows else method_for(problem)
    if method not in list(LimitMethod):
        raise InputError(f"method = '{method}' of a limit load: {nearest(method, LimitMethod)}")
    if follows and method == LimitMethod.INTERIOR_POINT:
        raise InputError(
            "solver, on_level, search and reached belong to a loading path, and the interior"
            " point method has none; remove them, or give method = 'path'."
        )
    return LimitMethod(method)


def limit_options(rtol: float, coulomb: bool = False) -> dict[str, Any]:
    """Return options of the Newton methods that suit a limit load with a relative tolerance.

    Args:
        rtol: Relative difference of the bounds at which the search ends.
        coulomb: Whether there is Coulomb's friction, whose shear limits converge no better than the
            steps.
    """
    # Largest tolerance of a level: with 1e-3, ζ was once 1e-4 above an upper bound.
    loosest = 1e-4
    # Tolerance of a level with Coulomb's friction: that of the shear limits, which its rounds
    # determine.
    friction_rtol = 1e-8
    return {"stopping": "stress", "tolerance": friction_rtol if coulomb else min(rtol, loosest)}
