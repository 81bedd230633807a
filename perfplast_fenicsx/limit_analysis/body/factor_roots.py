"""Factors that divide strengths until loads are carried just once, a root of each strict bound."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from perfplast_fenicsx.limit_analysis.body.body_bounds import BodyBounds
from perfplast_fenicsx.limit_analysis.body.one_bound import lower_bound, upper_bound
from perfplast_fenicsx.limit_analysis.body.radenkovic_pair import weaker_and_stronger
from perfplast_fenicsx.limit_analysis.conic.interior_steps import Verdict
from perfplast_fenicsx.limit_analysis.discrete.discrete_limit import InteriorStep, interior_point
from perfplast_fenicsx.limit_analysis.discrete.strength_reduction import weakened
from perfplast_fenicsx.limit_analysis.facets.associated_slip import with_strict_contact
from perfplast_fenicsx.limit_analysis.statements.bound import Bound
from perfplast_fenicsx.problem.problem import Problem

MOST_SEARCHES = 10
"""Searches for a root F, at most; three or four are usual."""

STEP = 1.3
"""Factor by which F changes where a side of μ is not known, or no two values are."""


@dataclass
class FactorRoots:
    """Bounds of μ at some F, on one mesh, and the roots of each.

    Attributes:
        problem: With the whole strengths.
        tolerance: Tolerance of the roots, relative.
        monitor: Called on every rank with F, and lower and upper bound of μ there.
        steps: Called on every rank after each step of the interior point method.
        steepness: |d ln μ/d ln F| that a single value is taken to have.
        found: Bounds by F, by which of both was sought.
        searches: Bounds that were computed, each side by itself.
        met: Whether :meth:`of_mesh` has come near a root.
    """

    problem: Problem
    tolerance: float
    monitor: Callable[[float, Bound, Bound], None] | None
    steps: Callable[[InteriorStep], None] | None
    steepness: float = 1.0
    found: dict[str, dict[float, BodyBounds]] = field(
        default_factory=lambda: {"lower": {}, "upper": {}}
    )
    searches: int = 0
    met: bool = False

    @property
    def rough(self) -> float:
        """How near the mesh's own μ is sought, and how near to 1 it is good enough, relative."""
        most = 0.1
        return min(10 * self.tolerance, most)

    @property
    def rtol(self) -> float:
        """How near each bound comes to the best one of its mesh, relative."""
        finer = 0.1  # share of the tolerance, in μ
        return finer * self.tolerance

    def of_mesh(self) -> float:
        """Where the mesh carries the loads once, about, and how steep μ is there. Collective."""
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
        finer = 1.03  # meshes fall with less strength by so much, about
        less = 0.96  # as steep as a coarse mesh bounds on finer ones are, by what was measured
        times = self._log_times(factor / finer) if factor in known else None
        if times is not None and math.isfinite(times):
            steepness = _steepness({factor: known[factor], factor / finer: times}, 1.0)
            self.steepness = less * steepness
        return factor

    def _log_times(self, factor: float) -> float | None:
        """Return the logarithm of μ of the mesh, about; None if it is not known, ∞ without end.

        Collective.
        """
        _, other = weaker_and_stronger(weakened(self.problem, factor))
        searched = with_strict_contact(other)
        found = interior_point(searched, self.rough, self.steps)
        if found.verdict is Verdict.UNBOUNDED:  # coarse meshes may have no motion that dilates so
            return math.inf
        times = None if found.standing is None else found.standing.lower
        return math.log(times) if times is not None and times > 0 else None

    def root(
        self,
        kind: str,
        known_elsewhere: float | None = None,
        other_side: float | None = None,
    ) -> float | None:
        """Return the factor at which a bound of μ is 1, on its safe side. Collective.

        None where no strict bound was found. Values that are not strict steer the search as well,
        and are never what is returned.

        Args:
            kind: "lower" or "upper".
            known_elsewhere: A factor on the safe side that another mesh has shown.
            other_side: One that is not, by a bound of the other kind. No root is beyond it. It is
                what counts where only a part of a stress was left by rounding, whose load says
                nothing of the root.
        """
        sign, found = 1 if kind == "lower" else -1, self.found[kind]
        first, last = (max, min) if kind == "lower" else (min, max)
        aim = 0.5  # where in the tolerance a root is aimed at, from its safe side
        failures, most_failures = 0, 3  # in a row, as of rounding, once a factor is known
        for _ in range(MOST_SEARCHES):
            known, strict = _known(found, kind)
            safe = [*self.shown(kind), *([known_elsewhere] if known_elsewhere else [])]
            best = first(safe) if safe else None
            room = self.tolerance * _steepness(known, self.steepness)
            in_part = best in known and _is_part(found[best], kind)
            if best in known and abs(known[best]) <= room and not in_part:
                break
            near = [it for it, times in known.items() if 0 <= sign * times <= 2 * aim * room]
            if near and not strict & set(near):  # further away from the root one may be strict
                aim *= 4
            beyond = [it for it in found if it not in known or sign * known[it] < 0]
            beyond += [other_side] if in_part and other_side else []
            if best is not None:
                beyond = [it for it in beyond if sign * (it - best) > 0]
            other = last(beyond) if beyond else None
            if best is not None and other is not None:
                if abs(math.log(other / best)) <= self.tolerance or failures >= most_failures:
                    break
                steers = known and not in_part
                aimed = _next(known, sign * aim * room, self.steepness) if steers else other
                factor = _within(aimed, best, other, self.tolerance / 2)
            elif known:
                factor = _next(known, sign * aim * room, self.steepness)
                if other_side and sign * (factor - other_side) >= 0:  # no root is beyond it
                    factor = math.sqrt(other_side * min(known, key=lambda it: abs(known[it])))
            else:  # confined bodies fall with less strength, coarse meshes carry more with more
                factor = (max if sign < 0 else min)(found) * STEP**-sign
            while known and factor in found and factor not in known:  # nothing came of it
                factor = math.sqrt(factor * min(known, key=lambda it: abs(math.log(it / factor))))
            if factor in found:
                break
            self._bound(kind, factor)
            failures = 0 if factor in _known(found, kind)[0] else failures + 1
        shown = self.shown(kind)
        return first(shown) if shown else None

    def _bound(self, kind: str, factor: float) -> None:
        """Bound μ at F from one side. Collective."""
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
        """Return bounds by F of those F with which the bodies are shown to stand, or to fall."""
        known, strict = _known(self.found[kind], kind)
        sign = 1 if kind == "lower" else -1
        return {F: self.found[kind][F] for F in strict if sign * known[F] >= 0}

    def is_strict(self, kind: str) -> bool:
        """Return whether a bound of a kind is strict at any F so far."""
        return bool(_known(self.found[kind], kind)[1])

    def keep(self, factor: float, bounds: BodyBounds, *kinds: str) -> None:
        """Take bounds at some F, of all kinds that they have."""
        for kind in kinds or self.found:
            self.found[kind][factor] = bounds
        if self.monitor is not None:
            self.monitor(factor, bounds.lower, bounds.upper)


def next_factor(curves: Sequence[FactorRoots], factor: float, bounds: BodyBounds) -> float:
    """Return the F at which the next mesh is bounded, by what is known of those before it.

    It is where the lower bound of μ is 1, about, between the largest F that is known to stand and
    the least that is known to fall. On coarse meshes that root is nearer to the one of the bodies
    than that of the upper bound. And on the last mesh the lower bound is then all but found.
    Where a mesh has no mechanism F grows as long as the loads are carried for certain, and else
    stays until finer cells have one.

    Args:
        curves: Curves of the meshes so far.
        factor: F of the last one.
        bounds: Of μ there.
    """
    most = 0.15  # by which ln F changes at most, as μ may be steep
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
    """Return F if it is well between two others, and else their mean.

    Args:
        factor: F.
        one: Another one.
        other: The other one, in the same form.
        near: How near to these it may be in any case, relative.
    """
    low, high = sorted((math.log(one), math.log(other)))
    margin = 0.05 * (high - low)
    margin = min(margin, near)
    if low + margin < math.log(factor) < high - margin:
        return factor
    return math.exp((low + high) / 2)


def _known(found: dict[float, BodyBounds], kind: str) -> tuple[dict[float, float], set[float]]:
    """Return ln μ by F, of bounds of one kind that have a value, and those F where it is strict."""
    known, strict = dict[float, float](), set[float]()
    for factor, bounds in found.items():
        bound = bounds.lower if kind == "lower" else bounds.upper
        if bound.value is not None and bound.value > 0:
            known[factor] = math.log(bound.value)
            if bound.strict:
                strict.add(factor)
    return known, strict


def _is_part(bounds: BodyBounds, kind: str) -> bool:
    """Return whether a bound is of as much of a stress as rounding has left."""
    return kind == "lower" and bounds.static is not None and bounds.static.is_part


def _steepness(known: dict[float, float], guess: float) -> float:
    """|d ln μ/d ln F|, between the two values next to μ = 1; a guess of a single one."""
    pair = sorted(known, key=lambda factor: abs(known[factor]))[:2]
    if len(pair) < 2:
        return guess
    one, other = pair
    return max(abs((known[one] - known[other]) / math.log(one / other)), 1.0)


def _next(known: dict[float, float], aim: float, guess: float) -> float:
    """Return where ln μ has the target value, by the secant of the two nearest values."""
    nearest = min(known, key=lambda factor: abs(known[factor] - aim))
    change = (known[nearest] - aim) / _steepness(known, guess)
    most = 3 * math.log(STEP)
    return nearest * math.exp(min(max(change, -most), most))
