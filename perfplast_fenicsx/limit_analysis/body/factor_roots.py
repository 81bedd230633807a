"""Find the strength factors F at which each strict bound of the multiple μ of the loads is 1."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

from perfplast_fenicsx.limit_analysis.body.body_bounds import BodyBounds
from perfplast_fenicsx.limit_analysis.body.bound_problems import weaker_and_stronger
from perfplast_fenicsx.limit_analysis.body.finer_meshes import number_of_cells
from perfplast_fenicsx.limit_analysis.body.limit_bounds import lower_bound, upper_bound
from perfplast_fenicsx.limit_analysis.conic.interior_steps import Verdict
from perfplast_fenicsx.limit_analysis.discrete.discrete_limit import InteriorStep, interior_point
from perfplast_fenicsx.limit_analysis.discrete.strength_reduction import weakened
from perfplast_fenicsx.limit_analysis.facets.entering import with_strict_contact
from perfplast_fenicsx.limit_analysis.statements.load_factor import Bound
from perfplast_fenicsx.problem.problem import Problem

MOST_SEARCHES = 10
"""Largest number of searches for a root F; three or four are usual."""

Monitor: TypeAlias = Callable[[float, Bound, Bound, int], None]
"""Called on every rank with F, both bounds of μ at this F (lower, upper), and the number of cells.
"""

Estimates: TypeAlias = Callable[[float, float | None, int], None]
"""Called on every rank with F, an estimate of μ at this F, and the number of cells. The estimate is
None if it was not found, and ∞ if μ seems to be unbounded.
"""

STEP = 1.3
"""Ratio of consecutive F while μ is unknown. A secant changes F at most by the third power of this
ratio."""


@dataclass
class FactorRoots:
    """Bounds of μ at several F on one mesh, and the roots F at which a bound is 1.

    Attributes:
        problem: The problem with the full strengths.
        tolerance: Relative tolerance of the roots.
        monitor: See :data:`Monitor`.
        steps: Called on every rank after each step of the interior point method.
        steepness: Assumed |d ln μ/d ln F| if only one value is known.
        found: Computed bounds by the kind that was sought ("lower", "upper") and by F.
        searches: Number of computed bounds; lower and upper bounds count separately.
        met: Whether :meth:`of_mesh` came close to a root.
        estimates: See :data:`Estimates`.
    """

    problem: Problem
    tolerance: float
    monitor: Monitor | None
    steps: Callable[[InteriorStep], None] | None
    steepness: float = 1.0
    found: dict[str, dict[float, BodyBounds]] = field(
        default_factory=lambda: {"lower": {}, "upper": {}}
    )
    searches: int = 0
    met: bool = False
    estimates: Estimates | None = None

    @property
    def rough(self) -> float:
        """Return the relative tolerance of the mesh's own μ, and of its root μ = 1."""
        most = 0.1
        return min(10 * self.tolerance, most)

    @property
    def rtol(self) -> float:
        """Return the permitted relative distance of a bound from the best bound on its mesh."""
        finer = 0.1  # ratio of the tolerance of μ to the tolerance of F
        return finer * self.tolerance

    def of_mesh(self) -> float:
        """Return an estimate of the root F of the mesh's own μ, and store the steepness of μ."""
        known: dict[float, float] = {}
        factor, strong, near = 1.0, 0.0, 1.05
        for _ in range(MOST_SEARCHES):
            times = self._log_times(factor)
            if times is None:
                factor /= STEP
                continue
            if math.isinf(times):
                strong, factor = factor, 0.0 if known else STEP * factor
            else:
                known[factor] = times
                if abs(times) <= self.rough:
                    self.met = True
                    break
                factor = _next(known, 0.0, self.steepness)
            if known and factor <= near * strong:
                if min(known) <= near * strong:
                    break
                factor = math.sqrt(strong * min(known))
        if known:
            factor = min(known, key=lambda it: abs(known[it]))
            self.steepness = _steepness(known, self.steepness)
        finer = 1.03  # approximate ratio of this root to the roots of finer meshes
        less = 0.96  # measured ratio of the slopes of finer meshes to the slope of a coarse mesh
        times = self._log_times(factor / finer) if factor in known else None
        if times is not None and math.isfinite(times):
            steepness = _steepness({factor: known[factor], factor / finer: times}, 1.0)
            self.steepness = less * steepness
        return factor

    def _log_times(self, factor: float) -> float | None:
        """Return the approximate ln μ of the mesh; None if μ is unknown, ∞ if μ is unbounded.

        Collective.
        """
        times = self._times(factor)
        if self.estimates is not None:
            self.estimates(factor, times, number_of_cells(self.problem.tagged_mesh))
        return math.log(times) if times is not None else None

    def _times(self, factor: float) -> float | None:
        """Return the approximate μ of the mesh; None if it is not found, ∞ if it is unbounded.

        Collective.
        """
        _, other = weaker_and_stronger(weakened(self.problem, factor))
        searched = with_strict_contact(other)
        found = interior_point(searched, self.rough, self.steps)
        if (
            found.verdict is Verdict.UNBOUNDED
        ):  # coarse meshes may have no motion with the required dilatancy
            return math.inf
        times = None if found.standing is None else found.standing.lower
        return times if times is not None and times > 0 else None

    def root(
        self,
        kind: str,
        known_elsewhere: float | None = None,
        other_side: float | None = None,
    ) -> float | None:
        """Return a proven factor F close to the root of one kind of bound of μ. Collective.

        The factor lies on the safe side of the root, at which the bound is 1. The function returns
        None if no strict bound proves a factor. Bounds that are not strict also guide the search,
        but the function never returns their factors.

        Args:
            kind: "lower" or "upper".
            known_elsewhere: A factor on the safe side that another mesh has proven.
            other_side: A factor on the unsafe side, from a bound of the other kind. No root lies
                beyond this factor.
        """
        sign, found = 1 if kind == "lower" else -1, self.found[kind]
        first, last = (max, min) if kind == "lower" else (min, max)
        aim = 0.5  # distance of the target from the root on its safe side, in tolerances
        failures, most_failures = (
            0,
            3,
        )  # allowed number of consecutive failures from rounding, once a factor is known
        for _ in range(MOST_SEARCHES):
            known, strict = _known(found, kind)
            safe = [*self.shown(kind), *([known_elsewhere] if known_elsewhere else [])]
            best = first(safe) if safe else None
            room = self.tolerance * _steepness(known, self.steepness)
            if best in known and abs(known[best]) <= room:
                break
            near = [it for it, times in known.items() if 0 <= sign * times <= 2 * aim * room]
            if near and not strict & set(near):  # bounds further from the root may be strict
                aim *= 4
            beyond = [it for it in found if it not in known or sign * known[it] < 0]
            if best is not None:
                beyond = [it for it in beyond if sign * (it - best) > 0]
            other = last(beyond) if beyond else None
            if best is not None and other is not None:
                if abs(math.log(other / best)) <= self.tolerance or failures >= most_failures:
                    break
                aimed = _next(known, sign * aim * room, self.steepness) if known else other
                factor = _within(aimed, best, other, self.tolerance / 2)
            elif known:
                factor = _next(known, sign * aim * room, self.steepness)
                if other_side and sign * (factor - other_side) >= 0:  # no root lies there
                    factor = math.sqrt(other_side * min(known, key=lambda it: abs(known[it])))
            else:
                # With less strength, confined bodies get a mechanism; with more strength, coarse
                # meshes carry the loads.
                factor = (max if sign < 0 else min)(found) * STEP**-sign
            while known and factor in found and factor not in known:  # the search gave no result
                factor = math.sqrt(factor * min(known, key=lambda it: abs(math.log(it / factor))))
            if factor in found:
                break
            self._bound(kind, factor)
            failures = 0 if factor in _known(found, kind)[0] else failures + 1
        shown = self.shown(kind)
        return first(shown) if shown else None

    def _bound(self, kind: str, factor: float) -> None:
        """Compute and store one kind of bound of μ at F. Collective."""
        self.searches += 1
        reduced = weakened(self.problem, factor)
        if kind == "upper":
            bounds = upper_bound(reduced, self.rtol, self.steps)
        else:
            beside = self.found["upper"]
            nearest = min(beside, key=lambda it: abs(math.log(it / factor)))
            bounds = lower_bound(reduced, beside[nearest], self.rtol, self.steps)
        self.keep(factor, bounds, kind)

    def shown(self, kind: str) -> dict[float, BodyBounds]:
        """Return bounds by F, for all F at which bodies provably stand (lower) or fall (upper)."""
        known, strict = _known(self.found[kind], kind)
        sign = 1 if kind == "lower" else -1
        return {F: self.found[kind][F] for F in strict if sign * known[F] >= 0}

    def failed(self, kind: str) -> str:
        """Return a clause on why the last search for a bound of this kind has no usable result."""
        bounds = list(self.found[kind].values())[-1]
        bound = bounds.lower if kind == "lower" else bounds.upper
        better = "no search on the last mesh gave a better one"
        return bound.why_not[-1].rstrip(".") if bound.why_not else better

    def is_strict(self, kind: str) -> bool:
        """Return whether a bound of this kind is strict at one or more F so far."""
        return bool(_known(self.found[kind], kind)[1])

    def keep(self, factor: float, bounds: BodyBounds, *kinds: str) -> None:
        """Store bounds at some F, under the given kinds; under both kinds if no kind is given."""
        for kind in kinds or self.found:
            self.found[kind][factor] = bounds
        if self.monitor is not None:
            cells = number_of_cells(self.problem.tagged_mesh)
            self.monitor(factor, bounds.lower, bounds.upper, cells)


def next_factor(curves: Sequence[FactorRoots], factor: float, bounds: BodyBounds) -> float:
    """Return the F for the next mesh, from the results on the previous meshes.

    The next F is the approximate root of the lower bound, or of the upper bound if there is no
    lower bound. On coarse meshes, the root of the lower bound is closer to the root of the body
    than the root of the upper bound is. On the last mesh, the root of the lower bound is also
    nearly the final result. The next F lies between the largest F at which the bodies provably
    stand and the least F at which they provably fall. On a mesh without a mechanism, F grows if the
    bodies provably carry the loads, and otherwise stays constant.

    Args:
        curves: Results on the meshes so far.
        factor: F on the last mesh.
        bounds: Bounds of μ at this F.
    """
    most = 0.15  # largest change of ln F, because μ may be steep
    stands = max((F for it in curves for F in it.shown("lower")), default=0.0)
    falls = min((F for it in curves for F in it.shown("upper")), default=math.inf)
    lower, upper = (it.value or 0.0 for it in (bounds.lower, bounds.upper))
    change = 0.0
    if upper > 0:
        change = math.log(lower or upper) / curves[-1].steepness
        change = min(max(change, -most), most)
    elif lower >= 1:
        change = most
    found = factor * math.exp(change)
    if stands < found < falls:
        return found
    if stands > 0 and found <= stands:
        beyond = curves[-1].tolerance
        return stands * math.exp(min(beyond, math.log(falls / stands) / 2))
    if stands > 0:
        return math.sqrt(stands * falls)
    return factor


def _within(factor: float, one: float, other: float, near: float) -> float:
    """Return F if it lies between two limits with a margin, and otherwise their geometric mean.

    Args:
        factor: F.
        one: One limit.
        other: The other limit, smaller or larger than the first.
        near: Largest margin, as a relative distance from the limits.
    """
    low, high = sorted((math.log(one), math.log(other)))
    margin = 0.05 * (high - low)
    margin = min(margin, near)
    if low + margin < math.log(factor) < high - margin:
        return factor
    return math.exp((low + high) / 2)


def _known(found: dict[float, BodyBounds], kind: str) -> tuple[dict[float, float], set[float]]:
    """Return ln μ by F for bounds of one kind with a value, and the set of F with strict bounds."""
    known, strict = dict[float, float](), set[float]()
    for factor, bounds in found.items():
        bound = bounds.lower if kind == "lower" else bounds.upper
        if bound.value is not None and bound.value > 0:
            known[factor] = math.log(bound.value)
            if bound.strict:
                strict.add(factor)
    return known, strict


def _steepness(known: dict[float, float], guess: float) -> float:
    """Return |d ln μ/d ln F| between the two values nearest to μ = 1, at least 1.

    The function returns the guess if fewer than two values are known.
    """
    pair = sorted(known, key=lambda factor: abs(known[factor]))[:2]
    if len(pair) < 2:
        return guess
    one, other = pair
    return max(abs((known[one] - known[other]) / math.log(one / other)), 1.0)


def _next(known: dict[float, float], aim: float, guess: float) -> float:
    """Return an estimate of the F at which ln μ equals ``aim``, by a secant of the known ln μ."""
    nearest = min(known, key=lambda factor: abs(known[factor] - aim))
    change = (known[nearest] - aim) / _steepness(known, guess)
    most = 3 * math.log(STEP)
    return nearest * math.exp(min(max(change, -most), most))
