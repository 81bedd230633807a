"""The limit load ζ_lim: where ζ(α) levels off, with bounds and the collapse mechanism.

ζ(α) is continuous, does not fall, and tends to ζ_lim as α grows (properties iii and v of Čermák,
Haslinger, Sysala, COMPLAS XII, 2013), so every ζ(α) reached is a lower bound of the discrete limit
load. The estimate fits ζ = ζ_∞ − c α^(−p) to the last three levels.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from dolfinx import fem

from perfplast_fenicsx.errors import InputError, nearest
from perfplast_fenicsx.limit_analysis.kinematic_bound import dissipation_bound
from perfplast_fenicsx.limit_analysis.limit_methods import (
    LimitLoad,
    LimitMethod,
    by_interior_point,
    method_for,
)
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.problem.state import Level, State
from perfplast_fenicsx.solvers.load_stepping import Reached, work_path
from perfplast_fenicsx.solvers.newton_options import NewtonOptions
from perfplast_fenicsx.solvers.work_newton import WorkNewton

MOST_LEVELS = 60
"""Levels after which a curve counts as one that does not level off."""

PLATEAU = 1e3
"""At so many times the work at first yield ζ no longer creeps, whatever an upper bound says."""

FAR = 1e5
"""So many times the work at first yield is looked at."""

STEADY = 1e-11
"""Growth of ζ, relative, that is rounding."""


@dataclass
class Search:
    """What the search for a limit load has found so far; plain data, for a restart.

    Attributes:
        points: (α − α₀, ζ) of the levels.
        rest: α₀, that of ζ = 0, once it is known; None where nothing but ζ loads the bodies.
        estimates: Of ζ_∞, one for each level from where there is one.
        upper: The last upper bound.
        levelled_off: Whether ζ had levelled off at the last level.
        ended: Whether the last level is the last.
        reason: Why.
        linear_solves: Linear systems solved.
    """

    points: list[tuple[float, float]] = field(default_factory=list)
    estimates: list[float] = field(default_factory=list)
    rest: float | None = None
    upper: float | None = None
    levelled_off: bool = False
    ended: bool = False
    reason: str = ""
    linear_solves: int = 0


def limit_load(
    problem: Problem,
    rtol: float = 1e-4,
    solver: WorkNewton | None = None,
    *,
    method: LimitMethod | str | None = None,
    monitor: Callable[[Any], None] | None = None,
    on_level: Callable[[Level, Search], None] | None = None,
    search: Search | None = None,
    reached: Reached | None = None,
) -> LimitLoad:
    """Find the limit load, its bounds and its mechanism. Collective.

    The interior point method (:func:`discrete_limit.interior_point`) brings bounds together, in 10
    to 20 factorisations; a loading by work, which gives the curve as well, goes on until ζ(α) has
    levelled off.

    Args:
        problem: The bodies and their loads.
        rtol: What the bounds may differ by, relative. Of a path: ζ has levelled off where the
            estimate is within this share of it, and so is the upper bound or the change of the
            estimate with the last level. Where there is an upper bound further off, the latter
            counts only at :data:`PLATEAU` times the work of first yield.
        solver: ALG3 or ALG4 for a path; the default is ALG3 with :func:`limit_options`.
        method: "interior-point" or "path"; the default is the first one where it knows the laws and
            a factorisation fits, if nothing is given that belongs to a path.
        monitor: Called on every rank after each iteration.
        on_level: Called on every rank after each level, with what is known by then.
        search: Found by an earlier run, to go on with.
        reached: Where that run had come to.

    Raises:
        InputError: If ``rtol`` is not between 0 and 1, all loads are constant, the interior point
            method is asked for beside constant loads and the like, or it finds that no stress can
            carry the loads.
    """
    if not 0 < rtol < 1:
        raise InputError(f"limit_tolerance = {rtol} is not between 0 and 1; try 1e-4.")
    follows = any(given is not None for given in (solver, on_level, search, reached))
    if _chosen(method, problem, follows) is LimitMethod.INTERIOR_POINT:
        return by_interior_point(problem, rtol, monitor)
    solver = solver or WorkNewton(problem, NewtonOptions(**limit_options(rtol)))
    search = search or Search()
    judge = _Judge(problem, rtol, search)
    first = search.linear_solves - solver.linear.solves
    levels: list[Level] = []
    last, before = (reached.last, reached.before) if reached else (None, None)
    for level in () if search.ended else work_path(solver, monitor, reached):
        if level.report.converged:
            levels.append(level)
            before, last = last, level.state
            judge(level, before)
        elif not search.levelled_off:
            search.reason = f"no further level could be solved: {level.report.reason}"
        search.linear_solves = first + solver.linear.solves + judge.projections
        if on_level is not None:
            on_level(level, search)
        if search.ended:
            break
    estimates = search.estimates
    return LimitLoad(
        method=LimitMethod.PATH,
        lower=max((zeta for _, zeta in search.points), default=0.0),
        estimate=estimates[-1] if search.levelled_off else None,
        residual=abs(1 - estimates[-2] / estimates[-1]) if len(estimates) > 1 else None,
        upper=search.upper,
        alpha=(search.rest or 0.0) + (search.points[-1][0] if search.points else 0.0),
        levelled_off=search.levelled_off,
        reason=search.reason,
        iterations=len(search.points) + (search.rest is not None),
        linear_solves=search.linear_solves,
        factorisations=None,
        mechanism=collapse_mechanism(problem, before, last),
        levels=levels,
    )


def _chosen(method: str | None, problem: Problem, follows: bool) -> LimitMethod:
    """The method that is asked for, or suits."""
    if method is None:
        return LimitMethod.PATH if follows else method_for(problem)
    if method not in list(LimitMethod):
        raise InputError(f"method = '{method}' of a limit load: {nearest(method, LimitMethod)}")
    if follows and method == LimitMethod.INTERIOR_POINT:
        raise InputError(
            "solver, on_level, search and reached belong to a loading path, which the interior"
            " point method does without; leave them out, or give method = 'path'."
        )
    return LimitMethod(method)


class _Judge:
    """Decides after each level whether ζ has levelled off."""

    def __init__(self, problem: Problem, rtol: float, search: Search) -> None:
        self._problem, self._rtol, self._search = problem, rtol, search
        self._from_rest = not problem.is_proportional()
        self.projections = 0

    def __call__(self, level: Level, before: State | None) -> None:
        """Add a level, and the state of the one before, to the search. Collective."""
        problem, rtol, search = self._problem, self._rtol, self._search
        if before is None and self._from_rest:
            search.rest = level.state.alpha
            return
        zeta, alpha = level.state.zeta, level.state.alpha - (search.rest or 0.0)
        search.points.append((alpha, zeta))
        search.levelled_off, first = False, search.points[0][0]
        estimate = extrapolated_limit(search.points[-3:])
        if estimate is not None:
            search.estimates.append(estimate)
        if estimate is not None and estimate - zeta <= rtol * zeta:
            mechanism = collapse_mechanism(problem, before, level.state)
            bound = dissipation_bound(problem, mechanism, level.state)
            self.projections += bound.solves
            upper = search.upper = bound.value
            known = search.estimates
            change = abs(estimate - known[-2]) / zeta if len(known) > 1 else np.inf
            search.levelled_off = bool(change <= rtol)
            search.reason = f"ζ has levelled off to {rtol:g} of its limit"
            if upper is not None and upper - zeta <= rtol * zeta:
                search.levelled_off = search.ended = True
                search.reason = f"the bounds are within {rtol:g} of each other"
                return
            # quadratic elements creep up to a limit, which a bound further off tells
            if search.levelled_off and not (upper is not None and alpha < PLATEAU * first):
                search.ended = True
                return
        if len(search.points) == MOST_LEVELS or alpha > FAR * first:
            search.levelled_off, search.ended = False, True
            search.reason = locking(search.points, level.report.plastic_cells, problem.degree)


def limit_options(rtol: float) -> dict[str, Any]:
    """Options of the Newton methods that suit a limit load with a relative tolerance.

    Displacements grow without bound, so that increments relative to them say little.
    """
    return {"stopping": "stress", "tolerance": min(rtol, 1e-3)}


def extrapolated_limit(points: Sequence[tuple[float, float]]) -> float | None:
    """ζ_∞ of ζ = ζ_∞ − c α^(−p) through three points (α, ζ) of rising α.

    Returns:
        The limit; None where fewer points are given or none fits because the curve does not flatten
        (p > 0 would have to be below 0.05).
    """
    if len(points) < 3:
        return None
    (a, x), (b, y), (c, z) = points
    if z - y <= STEADY * abs(z):
        return z
    if y - x <= 0:
        return None
    wanted = (z - y) / (y - x)

    def ratio(p: float) -> float:
        return float((1 - (c / b) ** -p) / ((a / b) ** -p - 1))

    low, high = 0.05, 50.0
    if wanted >= ratio(low):
        return None
    if wanted <= ratio(high):
        return z
    for _ in range(200):
        middle = (low + high) / 2
        low, high = (middle, high) if ratio(middle) > wanted else (low, middle)
    return z + (z - y) / ((c / b) ** high - 1)


def locking(points: Sequence[tuple[float, float]], plastic_cells: int, degree: int) -> str:
    """What to tell of a curve that does not level off.

    Args:
        points: (α, ζ) of its levels.
        plastic_cells: Of the last one.
        degree: Of the elements.
    """
    (first, _), (alpha, zeta) = points[0], points[-1]
    if plastic_cells == 0:
        return (
            f"ζ does not level off: nothing has yielded up to ζ = {zeta:.6g}; give the bodies"
            " that may collapse a yield stress"
        )
    told = (
        f"ζ does not level off: it has reached {zeta:.6g} and still rises at"
        f" {alpha / first:.3g} times the work at first yield; "
    )
    if degree == 1:
        return told + (
            "linear elements lock in plastic flow, which keeps the volume, so that the limit load"
            " of this mesh may be infinite; use quadratic ones (degree = 2 under [element])"
        )
    return told + "the loads may be such that the bodies carry any multiple of them; or refine"


def collapse_mechanism(problem: Problem, before: State | None, last: State | None) -> fem.Function:
    """The last increment of displacement, normalised to L₁(v) = 1; zero without one.

    Collective.
    """
    v = fem.Function(problem.V, name="mechanism")
    if last is None or (before is None and not problem.is_proportional()):
        return v
    v.x.array[:] = last.u.x.array
    if before is not None:
        v.x.array[:] -= before.u.x.array
    v.x.array[:] /= problem.loads.alpha(v.x.petsc_vec)
    return v
