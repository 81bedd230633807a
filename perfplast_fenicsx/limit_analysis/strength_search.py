"""Compute the strength reduction factor F as a function of the work ω by continuation in ω.

This is the indirect continuation of S. Sysala et al. (arXiv:2312.12170). For a prescribed work ω =
L(u), the method seeks the F and u for which the loads are in equilibrium. For any F, ALG3 computes
u and the multiplier ζ of the constraint L(u) = ω, with a duality gap. The secant method for ln ζ as
a function of ln F then solves ζ(F, ω) = 1. Each u is the initial guess for the next solve.

For fixed F, ζ is non-decreasing in ω and tends to the limit load ζ_lim(F). This limit load
decreases with F. Therefore ζ_lim(F(ω)) ≥ 1: the discrete problem carries the loads with each F(ω).
F(ω) tends to the factor of safety of the discrete problem.
"""

import logging
import math
from collections.abc import Callable
from dataclasses import dataclass, field

from perfplast_fenicsx.limit_analysis.discrete.strength_reduction import Weakening
from perfplast_fenicsx.limit_analysis.limit_search import limit_options
from perfplast_fenicsx.limit_analysis.statements.limit_checks import check_tolerance
from perfplast_fenicsx.limit_analysis.statements.load_factor import PathPoint, StrengthPath
from perfplast_fenicsx.problem.judged.report import Iteration
from perfplast_fenicsx.problem.judged.state import Level, State, check_slip_is_true
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.solvers.load_stepping import extrapolate
from perfplast_fenicsx.solvers.newton import Newton, WorkNewton
from perfplast_fenicsx.solvers.newton_options import NewtonOptions

log = logging.getLogger(__name__)


def strength_path(
    problem: Problem,
    tolerance: float = 1e-3,
    monitor: Callable[[Iteration], None] | None = None,
) -> StrengthPath:
    """Return F as a function of the work of all loads, until F has levelled off. Collective.

    Args:
        problem: The bodies and their loads; all loads are constant.
        tolerance: Relative tolerance of F. F has levelled off if, by extrapolation with the last
            slope, doubling the work would raise F by at most a quarter of the tolerance.
        monitor: Called on every rank after each Newton step.

    Raises:
        InputError: If ``tolerance`` is not between 0 and 1, if friction is associated, or if
            :class:`strength_reduction.Weakening` refuses the problem.
    """
    check_tolerance(tolerance)
    coulomb = problem.friction.follows_pressure
    weakening = Weakening(problem)
    options = NewtonOptions(**limit_options(1e-2 * tolerance, coulomb))
    search = _Search(weakening, WorkNewton(weakening.problem, options), tolerance, monitor)
    return search.follow()


def check_curve(problem: Problem) -> None:
    """Refuse problems for which F(ω) cannot be computed. Collective.

    Raises:
        InputError: In the cases of :func:`strength_path`.
    """
    check_slip_is_true(problem)
    Weakening(problem)


@dataclass
class _Point:
    """A point of the curve F(ω) with its converged state."""

    factor: float
    state: State


@dataclass
class _Search:
    """The state of a search for the curve F(ω).

    Attributes:
        weakening: The problem, whose strengths the search divides by F.
        solver: Solver of levels with a prescribed work.
        tolerance: Relative tolerance of F.
        monitor: Called after each Newton step.
        slope: Slope d ln ζ/d ln F at the last point.
        stride: Largest factor by which F changes between two levels.
        found: The points of the curve so far.
        counts: Newton steps and linear solves since the last point.
    """

    weakening: Weakening
    solver: WorkNewton
    tolerance: float
    monitor: Callable[[Iteration], None] | None
    slope: float = -1.0
    stride: float = 1.3
    found: list[PathPoint] = field(default_factory=list)
    counts: tuple[int, int] = (0, 0)

    def follow(self) -> StrengthPath:
        """Compute points until F has levelled off, and return the curve. Collective."""
        most_points = 80
        before: _Point | None = None
        last = self._first()
        if last is None:
            return StrengthPath(
                (),
                False,
                "no strength reduction factor was found with which this mesh carries the loads",
            )
        step, rise = 0.05 * abs(last.state.alpha), math.inf
        halvings = 0
        while len(self.found) < most_points:
            point = self._at(last.state.alpha + step, before, last)
            if point is None:
                halvings += 1
                if halvings > 6:
                    reason = f"no equilibrium was found beyond work {last.state.alpha:.6g}"
                    return StrengthPath(tuple(self.found), False, reason)
                step /= 2
                continue
            earlier, rise = rise, abs(point.factor - last.factor)
            before, last = last, point
            far = (last.state.alpha - self.found[0].work) / step
            if len(self.found) > 2 and rise * far <= 0.25 * self.tolerance * last.factor:
                return StrengthPath(tuple(self.found), True, "F has levelled off")
            if rise < 0.9 * earlier and earlier < math.inf:
                step *= 2
        return StrengthPath(tuple(self.found), False, f"{most_points} points were found")

    def _first(self) -> _Point | None:
        """Return the first equilibrium with plastic flow, or else the last elastic equilibrium.

        Collective.

        Returns:
            The point; None if no level converged.
        """
        newton = Newton(self.weakening.problem, self.solver.options, lender=self.solver)
        found: tuple[float, Level] | None = None
        factor = 1.0
        for _ in range(30):
            self.weakening.divide(factor)
            level = newton.solve(1.0, found[1].state if found else None, self.monitor)
            self._count(level)
            if level.report.converged:
                found = factor, level
                if level.report.plastic_fraction > 0:
                    break
                factor *= self.stride
            elif found is not None:
                break
            else:
                factor /= self.stride
        if found is None:
            return None
        self._keep(*found)
        return _Point(found[0], found[1].state)

    def _at(self, work: float, before: _Point | None, last: _Point) -> _Point | None:
        """Return the point with a given work; None if a level or the search for F has failed.

        Collective.
        """
        problem = self.weakening.problem
        start = last.state
        factor = last.factor
        if before is not None:
            start = extrapolate(problem, before.state, last.state, work) or last.state
            share = (work - last.state.alpha) / (last.state.alpha - before.state.alpha)
            ahead = share * math.log(last.factor / before.factor) / 2
            factor *= math.exp(min(ahead, math.log(self.stride)))
        known: dict[float, float] = {}
        most_levels = 20
        for _ in range(most_levels):
            self.weakening.divide(factor)
            level = self.solver.solve(work, start, self.monitor)
            self._count(level)
            zeta = level.report.zeta
            if not level.report.converged or not zeta > 0:
                return None
            known[factor] = math.log(zeta)
            start = level.state
            if abs(known[factor]) <= 1e-2 * self.tolerance * max(-self.slope, 1.0):
                self._keep(factor, level)
                return _Point(factor, level.state)
            factor = self._next(known)
        return None

    def _next(self, known: dict[float, float]) -> float:
        """Return a secant estimate of the root of ln ζ, limited to the known bracket."""
        nearest = sorted(known, key=lambda factor: abs(known[factor]))
        best = nearest[0]
        if len(nearest) > 1:
            other = nearest[1]
            slope = (known[best] - known[other]) / math.log(best / other)
            # Below this slope ζ hardly depends on F, for example in nearly elastic bodies.
            flat = -0.05
            self.slope = min(slope, flat)
        change = -known[best] / self.slope
        most = math.log(self.stride)
        factor = best * math.exp(min(max(change, -most), most))
        low = max((it for it, left in known.items() if left > 0), default=0.0)
        high = min((it for it, left in known.items() if left < 0), default=math.inf)
        if low < high < math.inf and low > 0 and not low < factor < high:
            factor = math.sqrt(low * high)
        return factor

    def _count(self, level: Level) -> None:
        newton, solves = self.counts
        report = level.report
        self.counts = newton + report.newton_iterations, solves + report.linear_solves

    def _keep(self, factor: float, level: Level) -> None:
        report = level.report
        told = (report.alpha, report.max_displacement, report.duality_gap)
        self.found.append(PathPoint(factor, *told, *self.counts))
        self.counts = (0, 0)
        log.info("F = %.6g at work %.6g", factor, report.alpha)
