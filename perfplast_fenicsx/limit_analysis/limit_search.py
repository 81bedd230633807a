"""Compute the limit load at which a loading path levels off, with its bounds and its mechanism.

ζ(α) is continuous, does not fall, and tends to ζ_lim as α grows (properties iii and v of Čermák,
Haslinger, Sysala, COMPLAS XII, 2013). Every computed ζ(α) is therefore a lower bound on the limit
load of the discrete problem. If the curve is nearly flat, the displacement increment is nearly a
mechanism. The mechanism gives an upper bound on the discrete limit load, and the direction for the
next extrapolation of the path. The search ends when both bounds agree. Both bounds hold for the
discrete problem, and not for the body itself.

With Coulomb's friction no limit theorem holds. In this case the module brackets the load at which
the loading path loses equilibrium. The lower end of the bracket is the largest load factor at which
a level (load step) has converged. The upper end is the smallest load factor for which the solver
has reported that there is no equilibrium. First the prescribed work α grows until ζ(α) has levelled
off. A level with prescribed work has a solution even if bodies slide. Then the search tries
slightly larger loads, from the state with the largest load, until the solver refuses a load. The
result holds only for the path that starts from the assembled bodies, for this mesh, and for the
friction iterations of :mod:`~perfplast_fenicsx.solvers.coulomb`. Other states of friction may carry
other loads.
"""

import logging
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from perfplast_fenicsx.errors import InputError, nearest
from perfplast_fenicsx.limit_analysis.discrete.body_cones import body_cones
from perfplast_fenicsx.limit_analysis.discrete.discrete_limit import drucker_bounds, interior_point
from perfplast_fenicsx.limit_analysis.discrete.limit_load import (
    TOLERANCE,
    LimitLoad,
    LimitMethod,
    method_for,
    resisted,
)
from perfplast_fenicsx.limit_analysis.path.limit_judge import (
    Judge,
    Points,
    Search,
    collapse_mechanism,
)
from perfplast_fenicsx.limit_analysis.statements.limit_checks import (
    check_bodies_have_limits,
    check_friction_has_limits,
    check_loads,
    check_something_yields,
    check_tolerance,
)
from perfplast_fenicsx.problem.judged.state import Level, State
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.rounding import ROUNDING
from perfplast_fenicsx.solvers.linear.factorisation import TooLarge
from perfplast_fenicsx.solvers.load_stepping import Reached, work_path
from perfplast_fenicsx.solvers.newton import Newton, WorkNewton
from perfplast_fenicsx.solvers.newton_options import NewtonOptions
from perfplast_fenicsx.solvers.verdicts import SLIDES

log = logging.getLogger(__name__)


SHARES = (0.5, 0.25, 0.75)
"""Positions of trial loads between the largest carried and the smallest refused load, as fractions
of the distance. The search tries the midpoint first. If the solver neither solves nor refuses the
level at the midpoint, the search tries the other positions.
"""


OnLevel = Callable[[Level, Search], None]
"""Called on every rank after a level, with the level and the state of the search."""


def check_resolution(rtol: float, solver: WorkNewton) -> None:
    """Refuse a tolerance that is too small to distinguish sliding bodies from bodies at rest.

    Args:
        rtol: Relative difference between the refused and the carried load at which the search
            ends.
        solver: Solver of the path.

    Raises:
        InputError: If the tolerance is too small; the message gives the smallest allowed tolerance.
    """
    finest = 10 * max(SLIDES, solver.options.tolerance)
    if rtol < finest:
        raise InputError(
            f"limit_tolerance = {rtol:g} is too small: with Coulomb's friction, it cannot "
            f"distinguish sliding bodies from bodies at rest; give {finest:g} or more."
        )


def coulomb_limit(
    problem: Problem,
    rtol: float,
    solver: WorkNewton,
    monitor: Callable[[Any], None] | None = None,
    on_level: OnLevel | None = None,
    search: Search | None = None,
    reached: Reached | None = None,
) -> LimitLoad:
    """Return a bracket of the load at which equilibrium is lost, and Drucker's bounds if known.

    Collective.

    Args:
        problem: The bodies and their loads, with Coulomb's friction in some places.
        rtol: Largest relative difference between the carried and the refused load.
        solver: ALG3 or ALG4. Levels with prescribed loads use the same linear solvers.
        monitor: Called on every rank after each iteration.
        on_level: Called on every rank after each level that carries its load, and in any case after
            the level of the constant loads.
        search: Search of an earlier run, to continue.
        reached: Last converged state of the earlier run.

    Raises:
        InputError: If the tolerance is too small to distinguish a sliding body from a body at rest.
    """
    check_resolution(rtol, solver)
    direct = method_for(problem) is LimitMethod.INTERIOR_POINT and not problem.loads.has_dead()
    drucker = drucker_bounds(problem) if direct else None
    search = search or Search()
    path = _Path(solver, rtol, search, monitor, on_level)
    path.follow(reached)
    if path.last is not None and not search.ended:
        path.bracket()
    return LimitLoad(
        method=LimitMethod.PATH,
        lower=max(search.lower, 0.0),
        estimate=search.lower if search.levelled_off else None,
        residual=None,
        upper=search.upper,
        alpha=(search.rest or 0.0) + (search.points[-1][0] if search.points else 0.0),
        levelled_off=search.levelled_off,
        reason=search.reason,
        iterations=len(search.points) + (search.rest is not None) + path.refused,
        linear_solves=search.linear_solves,
        factorisations=None,
        mechanism=collapse_mechanism(problem, path.before, path.last),
        levels=path.levels,
        theorem=False,
        drucker=drucker,
    )


@dataclass
class _Path:
    """The state of a search.

    Attributes:
        solver, rtol, search, monitor, on_level: As for :func:`coulomb_limit`.
        levels: The levels that carry their loads.
        before: State of the level before ``last`` among the levels whose work exceeds the work of
            all earlier levels.
        last: State of the last level whose work exceeds the work of all earlier levels.
        most: State with the largest carried load.
        refused: Number of trial loads that were not carried.
    """

    solver: WorkNewton
    rtol: float
    search: Search
    monitor: Callable[[Any], None] | None
    on_level: OnLevel | None
    levels: list[Level] = field(default_factory=list)
    before: State | None = None
    last: State | None = None
    most: State | None = None
    refused: int = 0

    def __post_init__(self) -> None:
        self._solved = self.search.linear_solves - self.solver.linear.solves

    def follow(self, reached: Reached | None) -> None:
        """Solve levels with growing prescribed work until ζ has levelled off or a level fails.

        Collective.
        """
        search = self.search
        if reached is not None:
            self.before, self.last = reached.before, reached.last
            self.most = reached.last
        if search.ended or has_levelled(search.points, self.rtol):
            return
        # Number of levels with prescribed work after which the search decides that ζ does not level
        # off.
        most_works = 40
        # Largest ratio of ζ to its first value, at which the search ends if nothing slips or
        # yields.
        farthest = 1e12
        for level in work_path(self.solver, self.monitor, reached):
            search.linear_solves = self._solved + self.solver.linear.solves
            if not level.report.converged:
                search.reason = f"no further work could be solved: {level.report.reason}"
                if self.last is None:
                    search.ended = True
                    search.reason = f"the constant loads alone: {level.report.reason}"
                    self._tell(level)
                return
            self.before, self.last = self.last, level.state
            if self.before is None:
                search.rest = level.state.alpha
            else:
                search.points.append((level.state.alpha - (search.rest or 0.0), level.state.zeta))
            if self.most is None or level.state.zeta >= self.most.zeta:
                self.most = level.state
            self._carried(level)
            if has_levelled(search.points, self.rtol):
                return
            far = search.points and abs(level.state.zeta) > farthest * abs(search.points[0][1])
            if far or len(search.points) >= most_works:
                search.ended = True
                search.reason = (
                    f"ζ does not level off: it has reached {level.state.zeta:.6g} and still rises;"
                    " the bodies may carry any multiple of the loads"
                )
                return

    def bracket(self) -> None:
        """Try loads until the carried and the refused load agree to the tolerance. Collective."""
        search, rtol = self.search, self.rtol
        direct = Newton(self.solver.problem, self.solver.options, lender=self.solver)
        # A ζ below this value counts as zero, because the given loads have a realistic size.
        least_load = 1e-8
        low = search.lower if search.lower > least_load else 0.0
        # Relative increase of the next trial load if ζ has not levelled off.
        wider = 0.1
        step = rtol if has_levelled(search.points, rtol) else wider
        why, open_end, unknown = "", search.reason, 0
        # Number of trial loads after which the search ends with the present bracket.
        most_loads = 40
        for _ in range(most_loads):
            width = None if search.upper is None else search.upper - low
            if low > 0 and width is not None and width <= rtol * low * (1 + ROUNDING):
                search.levelled_off = True
                break
            zeta = trial(low, search.upper, step, unknown)
            if unknown == len(SHARES) or zeta < least_load:
                break
            level = direct.solve(zeta, self.most, self.monitor)
            search.linear_solves = self._solved + self.solver.linear.solves
            told = f"at ζ = {zeta:.6g}: {level.report.reason}"
            if level.report.converged:
                low, self.most, unknown = zeta, level.state, 0
                if self.last is not None and level.state.alpha > self.last.alpha:
                    self.before, self.last = self.last, level.state
                search.points.append((level.state.alpha - (search.rest or 0.0), zeta))
                self._carried(level)
            elif level.refuted:
                log.info("refused %s", told)
                search.upper, why, unknown = zeta, told, 0
                self.refused += 1
            else:
                open_end = (
                    f"the solver neither converged nor showed that no equilibrium exists {told}"
                )
                log.info("%s", open_end)
                unknown += 1
                self.refused += 1
            step *= 2
        search.ended = True
        search.reason = why
        if low == 0 and search.upper is not None and not unknown:
            search.reason = f"no load factor down to ζ = {least_load:g} is carried; {why}"
        elif not search.levelled_off:
            search.reason = f"this is the bracket so far; {open_end or 'too many loads were tried'}"

    def _carried(self, level: Level) -> None:
        self.levels.append(level)
        self._tell(level)

    def _tell(self, level: Level) -> None:
        if self.on_level is not None:
            self.on_level(level, self.search)


def has_levelled(points: Points, rtol: float) -> bool:
    """Return whether the last ζ exceeds all earlier values by at most the tolerance.

    Args:
        points: Pairs (α, ζ) of the levels; each level multiplies the work by a factor.
        rtol: Relative tolerance.
    """
    if len(points) < 2:
        return False
    before, zeta = max(zeta for _, zeta in points[:-1]), points[-1][1]
    return zeta - before <= rtol * abs(zeta)


def trial(low: float, refused: float | None, step: float, unknown: int) -> float:
    """Return the next load factor to try.

    Args:
        low: Largest carried load factor; 0 if there is no such factor.
        refused: Smallest refused load factor; None if there is no such factor.
        step: Relative increase over ``low`` while no load is refused.
        unknown: Number of undecided trial loads since ``low`` or ``refused`` last changed.
    """
    if low == 0:
        return (1.0 if refused is None else refused / 10) / 10**unknown
    if refused is None:
        return low * (1 + step)
    return low + SHARES[min(unknown, len(SHARES) - 1)] * (refused - low)


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

    The interior point method (:func:`discrete_limit.interior_point`) finds both bounds with 10 to
    20 factorisations. A loading path with prescribed work also gives the load-work curve, and
    continues until ζ(α) has levelled off. With Coulomb's friction no limit theorem holds; the
    result is the load at which the path loses equilibrium (:func:`coulomb_limit`).

    Args:
        problem: The bodies and their loads.
        rtol: Relative distance of the bounds at which the search ends. If the laws give no
            mechanism on a path, the tolerance applies to the difference of the estimate from ζ, and
            from the estimate of the previous level.
        solver: ALG3 or ALG4 for a path; the default is ALG3 with :func:`limit_options`.
        method: "interior-point" or "path". The default is the interior point method if it supports
            the laws, if the problem has at most :data:`limit_load.MOST_UNKNOWNS` unknowns, and if
            no argument of a path is given. If the factorisation exhausts memory nevertheless, the
            function follows a path instead.
        monitor: Called on every rank after each iteration.
        on_level: Called on every rank after each level, with the level and the state of the search.
        search: State of an earlier search, to continue it.
        reached: Last converged state of the earlier search.

    Raises:
        InputError: If ``rtol`` is not between 0 and 1, or is too small to distinguish sliding from
            rest with Coulomb's friction; if all loads are constant and the method is a path; if a
            body hardens; if no stress can carry the loads; or if the interior point method is
            requested for a problem that it does not support or that does not fit into memory.
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
                    f"{str(fault).removesuffix('.')}; give limit_method = 'path', which needs no "
                    "factorisation."
                ) from fault
            log.info(
                "%s The program follows a loading path instead, which needs no factorisation.",
                fault,
            )
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
    """Return the limit load at which a loading path levels off (:func:`limit_load`). Collective."""
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
    """Refuse the problems that :func:`limit_load` refuses, without solving them. Collective.

    Args:
        problem: The bodies and their loads.
        rtol: Relative difference of the bounds at which the search ends.
        solver: Solver of a path; None for the interior point method.

    Raises:
        InputError: In the cases of :func:`limit_load`, except for loads that no stress can carry,
            and for lack of memory.
    """
    check_tolerance(rtol)
    check_bodies_have_limits(problem)
    if solver is not None and problem.friction.follows_pressure:
        check_resolution(rtol, solver)
        return
    check_friction_has_limits(problem)
    if solver is None:
        given = problem.given
        rubs = any(one.rubs for one in (*given.contacts, *given.obstacles))
        check_something_yields(given.materials.values(), rubs)
        check_loads(problem)
        body_cones(problem)


def _chosen(method: str | None, problem: Problem, follows: bool) -> LimitMethod:
    """Return the requested method, or by default the method that suits the problem."""
    if method is None:
        return LimitMethod.PATH if follows else method_for(problem)
    if method not in list(LimitMethod):
        raise InputError(f"method = '{method}' is unknown; {nearest(method, LimitMethod)}")
    if follows and method == LimitMethod.INTERIOR_POINT:
        raise InputError(
            "solver, on_level, search and reached are arguments of a loading path, which the "
            "interior point method does not follow; remove them, or give method = 'path'."
        )
    return LimitMethod(method)


def limit_options(rtol: float, coulomb: bool = False) -> dict[str, Any]:
    """Return the options of Newton's method for a limit load with a given relative tolerance.

    Args:
        rtol: Relative difference of the bounds at which the search ends.
        coulomb: Whether there is Coulomb's friction. Its shear limits converge only to the
            tolerance of the Newton steps.
    """
    # Largest tolerance of a level. With 1e-3, ζ was once 1e-4 (relative) above an upper bound.
    loosest = 1e-4
    # Tolerance of a level with Coulomb's friction. It equals the tolerance of the shear limits,
    # which the friction iterations determine.
    friction_rtol = 1e-8
    return {"stopping": "stress", "tolerance": friction_rtol if coulomb else min(rtol, loosest)}
