"""Compute a factor of safety, which divides strengths, with proven lower and upper bounds.

If F divides the strengths (cohesions, slopes of friction and yield stresses), the bodies carry the
loads μ(F) times (:class:`load_factor.Question`), and μ decreases as F increases. If the weakened
bodies have an admissible stress in balance with the loads, the factor of safety is at least F. If
the loads do more work on a mechanism than the weakened bodies dissipate, the factor is at most F.
The module seeks the root F of ln μ = 0 for each strict bound of μ separately, by secants of ln μ
over ln F. Each result is slightly on the safe side of its root.
"""

import logging
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.limit_analysis.blocks.rigid_blocks import are_blocks
from perfplast_fenicsx.limit_analysis.body.adaptation import Adaptation
from perfplast_fenicsx.limit_analysis.body.adaptive_meshes import nearness
from perfplast_fenicsx.limit_analysis.body.body_bounds import (
    NOT_SOUGHT,
    BodyBounds,
    sentences,
    taken_as,
)
from perfplast_fenicsx.limit_analysis.body.bound_problems import with_matching_facets
from perfplast_fenicsx.limit_analysis.body.factor_roots import (
    Estimates,
    FactorRoots,
    Monitor,
    next_factor,
)
from perfplast_fenicsx.limit_analysis.body.finer_meshes import finer_mesh, number_of_cells
from perfplast_fenicsx.limit_analysis.body.limit_bounds import NOT_ASKED, limit_bounds, upper_bound
from perfplast_fenicsx.limit_analysis.body.singular_points import with_room_for_stress
from perfplast_fenicsx.limit_analysis.conic.interior_steps import StopSearch
from perfplast_fenicsx.limit_analysis.discrete.discrete_limit import InteriorStep
from perfplast_fenicsx.limit_analysis.discrete.strength_reduction import (
    check_stands,
    kept_strengths,
    weakened,
)
from perfplast_fenicsx.limit_analysis.statements.limit_checks import check_tolerance
from perfplast_fenicsx.limit_analysis.statements.load_factor import Bound, Standing, StrengthPath
from perfplast_fenicsx.materials.nonassociated_flow import by_davis
from perfplast_fenicsx.outcome_words import factor_words, percent
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.rounding import rounded_down, rounded_up
from perfplast_fenicsx.solvers.linear.factorisation import TooLarge
from perfplast_fenicsx.tables import COLOURS, NotebookResult, Row

log = logging.getLogger(__name__)

FAR = 100.0
"""Factor that multiplies or divides the strengths to test whether F affects the collapse."""

INTERRUPTED = "The search was interrupted."
"""The sentence on the result of a stopped search."""


@dataclass(frozen=True)
class FactorOfSafety(NotebookResult):
    """Bounds on a factor of safety, with their proofs.

    Attributes:
        lower: With strengths divided by this factor, the bodies carry the loads; None if no such
            factor was found.
        upper: With strengths divided by this factor, the bodies do not carry the loads; None if no
            such factor was found.
        stands: Result with the lower bound at the lower factor, whose stress is the proof.
        falls: Result with the upper bound at the upper factor, whose mechanism is the proof.
        last: Result with the last computed upper bound, at any factor. For rigid blocks, the
            result at the upper factor, if there is one.
        bodies: The problem with the given strengths, on the last mesh.
        curve: Factors F, each with the strict lower and upper bound on the multiple of the loads
            that the bodies carry; None for a missing bound.
        searches: Number of computed bounds on all meshes; lower and upper bounds count separately.
        taken: Idealisations of ground, surfaces, pore pressures and strengths, as clauses
            (:func:`body_bounds.taken_as`).
        estimate: Whether Davis' associated ground replaces the declared ground; the values are then
            not bounds.
        path: The curve of F over the work, on the last mesh; None if it was not requested.
        kept: Strengths that F does not divide, in words.
        missed: A sentence on why a factor is missing, or why both factors are further apart than
            requested; empty otherwise.
        cells: Number of cells of each mesh; empty for rigid blocks.
    """

    lower: float | None
    upper: float | None
    stands: BodyBounds | None
    falls: BodyBounds | None
    last: BodyBounds
    bodies: Problem
    curve: tuple[tuple[float, float | None, float | None], ...]
    searches: int
    taken: tuple[str, ...] = ()
    estimate: bool = False
    path: StrengthPath | None = None
    kept: tuple[str, ...] = ()
    missed: str = ""
    cells: tuple[int, ...] = ()

    def table(self) -> dict[str, Any]:
        """Return the table for ``summary.json``."""
        known: dict[str, Any] = {
            "lower": self.lower,
            "upper": self.upper,
            "in_words": self.in_words(),
        }
        known |= {"curve": self.rows(), "searches": self.searches, "estimate": self.estimate}
        known |= {"kept": list(self.kept), "cells": list(self.cells)}
        return known | {"path": self.path and self.path.table()}

    def rows(self) -> list[Row]:
        """Return a row for each F, with strict bounds of the carried multiple of the loads."""
        return [dict(zip(("factor", "lower", "upper"), row, strict=True)) for row in self.curve]

    def draw_into(self, axes: Any) -> None:
        """Draw both bounds of the multiple of the loads over F, and the two factors of safety."""
        for side, factor in (("lower", self.lower), ("upper", self.upper)):
            known = [(row["factor"], row[side]) for row in self.rows() if row[side] is not None]
            label = {"lower": "carried for certain", "upper": "carried at most"}[side]
            if known:
                axes.plot(*zip(*known, strict=True), "o-", color=COLOURS[side], label=label)
            if factor is not None:
                shown = (rounded_down if side == "lower" else rounded_up)(factor)
                proves = {"lower": "stands with", "upper": "falls at"}[side]
                axes.axvline(factor, ls="--", color=COLOURS[side], label=f"{proves} F = {shown}")
        axes.axhline(1.0, color="black", linewidth=0.8)
        axes.set(xlabel="F, by which strengths are divided", ylabel="multiple of the loads")
        axes.set_title("Davis' estimate" if self.estimate else "Factor of safety")
        axes.grid(alpha=0.3)
        axes.legend()

    def in_words(self) -> str:
        """Return a text on the proven factors and on what they assume."""
        sides = factor_words(self.lower, self.upper, self.estimate)
        if not sides:
            return f"Nothing is proven for the factor of safety. {self.missed}".rstrip()
        body = "By Davis' estimate the body" if self.estimate else "The body"
        but = f" but {' and '.join(self.kept)}" if self.kept else ""
        said = f"{body} {', and '.join(sides)}, if all strengths{but} are divided by F."
        return said + (self.missed and f" {self.missed}") + sentences(self.taken)

    def news(self) -> str:
        """Return a sentence on the last result: the curve F(ω) if it exists, else the bounds."""
        return self.path.in_words() if self.path else self.in_words()


def factor_of_safety(
    problem: Problem,
    tolerance: float = 1e-3,
    adaptation: Adaptation | None = None,
    monitor: Monitor | None = None,
    steps: Callable[[InteriorStep], None] | None = None,
    estimates: Estimates | None = None,
) -> FactorOfSafety:
    """Return strict bounds on the factor of safety of constant loads. Collective.

    Args:
        problem: The bodies and their loads; all loads are constant.
        tolerance: Relative tolerance of the roots on their mesh.
        adaptation: Stopping criterion of the refinement; the function seeks F again on each mesh.
            The criterion ``until`` refers to the gap of μ, which with friction changes more than F.
            None to use the mesh of the problem.
        monitor: See :data:`factor_roots.Monitor`.
        steps: Called on every rank after each step of the interior point method.
        estimates: See :data:`factor_roots.Estimates`.

    Raises:
        StopSearch: If ``monitor``, ``steps`` or ``estimates`` raises it. Its attribute ``safety``
            then contains the proven factors so far.
        InputError: If a load grows, if F divides no strength, or if
            :func:`limit_bounds.limit_bounds` refuses the problem. If the bodies fall at any F, or
            stand at any F.
    """
    check_tolerance(tolerance)
    given = problem.given
    rubbing = [*given.contacts, *given.obstacles]
    check_stands(given.loads, given.materials, rubbing)
    if are_blocks(problem):
        return _of_blocks(problem, tolerance, monitor)
    problem = with_matching_facets(problem)
    first = FactorRoots(problem, tolerance, monitor, steps, estimates=estimates)
    curves: list[FactorRoots] = []
    try:
        ended = _compute_curves(curves, first, adaptation)
        for kind, other in (("upper", "lower"), ("lower", "upper")):
            _root_of_finest(curves, kind, other)
    except StopSearch as stop:
        if curves:
            stop.safety = replace(_from_curves(problem, curves, None, ""), missed=INTERRUPTED)
        raise
    return _from_curves(problem, curves, adaptation, ended)


def _from_curves(
    problem: Problem, curves: Sequence[FactorRoots], adaptation: Adaptation | None, ended: str
) -> FactorOfSafety:
    """Return the best proven factors on all meshes so far. Collective.

    Args:
        problem: The problem on the first mesh.
        curves: Results on all meshes.
        adaptation: The requested adaptation; None without a request.
        ended: Why there is no finer mesh; empty if ``until`` was met at one F.
    """
    given = problem.given
    rubbing = [*given.contacts, *given.obstacles]
    (lower, stands), (upper, falls) = (_best(curves, kind) for kind in ("lower", "upper"))
    rows: dict[float, tuple[float | None, float | None]] = {}
    for curve in curves:
        for of_kind in curve.found.values():
            for factor, bounds in of_kind.items():
                rows[factor] = _better_of(_strict(bounds), rows.get(factor, (None, None)))
    return FactorOfSafety(
        lower=lower,
        upper=upper,
        stands=stands,
        falls=falls,
        last=list(curves[-1].found["upper"].values())[-1],
        bodies=curves[-1].problem,
        curve=tuple(sorted((factor, *sides) for factor, sides in rows.items())),
        searches=sum(curve.searches for curve in curves),
        taken=taken_as(problem),
        estimate=by_davis(given.materials),
        kept=tuple(kept_strengths(given.materials, rubbing)),
        missed=_missed(lower, upper, curves, adaptation, ended),
        cells=tuple(number_of_cells(curve.problem.tagged_mesh) for curve in curves),
    )


def _missed(
    lower: float | None,
    upper: float | None,
    curves: Sequence[FactorRoots],
    adaptation: Adaptation | None,
    ended: str,
) -> str:
    """Return why a factor is missing, or why both are further apart than requested.

    Args:
        lower: Factor at which the bodies provably stand; None if it is missing.
        upper: Factor at which the bodies provably fall; None if it is missing.
        curves: Results on all meshes.
        adaptation: The adaptation with the requested ``until``; None without a request.
        ended: Why there is no finer mesh; empty if the bounds at one F met ``until``.

    Returns:
        A sentence; empty if both factors exist and are as close as requested, or without a request.
    """
    last = curves[-1]
    if lower is None or upper is None:
        kind = "upper" if upper is None else "lower"
        return f"No {kind} factor was found: {last.failed(kind)}."
    if adaptation is None or isinstance(adaptation.until, str):
        return ""
    apart = upper / lower - 1
    if apart <= adaptation.until:
        return ""
    cells = number_of_cells(last.problem.tagged_mesh)
    why = [ended] if ended else []
    for kind, factor in (("lower", lower), ("upper", upper)):
        if factor not in last.shown(kind):
            why.append(f"the {kind} factor comes from an earlier mesh, because {last.failed(kind)}")
    why = why or [f"the search for each factor ends at limit_tolerance = {last.tolerance:g}"]
    return (
        f"The factors are {percent(apart)} apart, more than until = {adaptation.until:g}:"
        f" {'; '.join(why)}. The last mesh has {cells} cells."
    )


def _of_blocks(
    problem: Problem,
    tolerance: float,
    monitor: Monitor | None,
) -> FactorOfSafety:
    """Return the factor of safety of bodies that cannot yield, from their joints. Collective.

    Joints without adhesion carry every multiple of the constant loads, or no multiple. The
    function therefore bisects F between a factor at which the joints carry the loads and a factor
    at which they do not.
    """
    found: dict[float, BodyBounds] = {}

    def bounds(factor: float) -> BodyBounds:
        if factor not in found:
            found[factor] = limit_bounds(weakened(problem, factor), 0.1 * tolerance)
            if monitor is not None:
                cells = number_of_cells(problem.tagged_mesh)
                monitor(factor, found[factor].lower, found[factor].upper, cells)
        return found[factor]

    def edge(holds: Callable[[BodyBounds], bool]) -> tuple[float, float]:
        """Return two close factors; a condition holds at the first and not at the second.

        If the condition holds at no tested factor, the first factor is 1 / FAR, which was not
        tested. If it holds at all of them, the second factor is FAR.
        """
        low, high, factor = 1 / FAR, FAR, 1.0
        while math.log(high / low) > tolerance:
            low, high = (factor, high) if holds(bounds(factor)) else (low, factor)
            factor = math.sqrt(low * high)
        return low, high

    try:
        lower, _ = edge(_stands)
        _, upper = edge(lambda it: not _falls(it))
    except StopSearch as stop:
        if found:
            stop.safety = _from_joints(problem, found, INTERRUPTED)
        raise
    given = problem.given
    kept = kept_strengths(given.materials, [*given.contacts, *given.obstacles])
    if upper not in found:
        raise _stands_anyway(kept)
    if lower not in found and upper <= (1 + tolerance) / FAR:
        raise _falls_anyway(kept)
    return _from_joints(problem, found)


def _stands(bounds: BodyBounds) -> bool:
    """Return whether the loads are provably carried."""
    return Standing(*_strict(bounds)).stands


def _falls(bounds: BodyBounds) -> bool:
    """Return whether the loads are provably not carried."""
    return Standing(*_strict(bounds)).falls


def _from_joints(
    problem: Problem, found: dict[float, BodyBounds], missed: str = ""
) -> FactorOfSafety:
    """Return the best proven factors of rigid blocks so far. Collective.

    Args:
        problem: The blocks with the given strengths.
        found: Bounds of μ by F.
        missed: See :class:`FactorOfSafety`.
    """
    given = problem.given
    kept = kept_strengths(given.materials, [*given.contacts, *given.obstacles])
    lower = max((factor for factor, it in found.items() if _stands(it)), default=None)
    upper = min((factor for factor, it in found.items() if _falls(it)), default=None)
    rows = {factor: _strict(it) for factor, it in found.items()}
    return FactorOfSafety(
        lower=lower,
        upper=upper,
        stands=None if lower is None else found[lower],
        falls=None if upper is None else found[upper],
        last=list(found.values())[-1] if upper is None else found[upper],
        bodies=problem,
        curve=tuple(sorted((factor, *sides) for factor, sides in rows.items())),
        searches=2 * len(found),
        taken=taken_as(problem),
        kept=tuple(kept),
        missed=missed,
    )


def times_in_words(
    factor: float, lower: Bound, upper: Bound, cells: int, estimate: bool = False
) -> str:
    """Return a sentence on the multiple of the loads that bodies with divided strengths carry.

    Args:
        factor: F.
        lower: Lower bound on the multiple.
        upper: Upper bound on the multiple.
        cells: Number of cells of the mesh.
        estimate: Whether both bounds are for Davis' associated ground.
    """
    sides = []
    if lower.strict_value is not None:
        least = "at least" if estimate else "for certain"
        sides.append(f"{rounded_down(lower.strict_value)} times {least}")
    if upper.strict_value is not None:
        sides.append(f"{rounded_up(upper.strict_value)} times at most")
    davis = ", by Davis' estimate," if estimate else ""
    divided = f"{cells} cells: with strengths divided by F = {factor:.6g}"
    if sides:
        return f"{divided} the loads are carried{davis} {' and '.join(sides)}."
    words = {True: "there is no {} bound", False: "the {} bound is not strict"}
    reasons = [
        f"{words[it.value is None].format(it.kind)}: {why}"
        for it in (lower, upper)
        for why in it.why_not[-1:]  # the checker's reason follows doubts
        if why not in (NOT_ASKED, *NOT_SOUGHT.why_not)
    ]
    told = "; ".join(dict.fromkeys(reasons)) or "no bound was sought"
    return f"{divided} there is no bound on the multiple of the loads: {told.rstrip('.')}."


def estimate_in_words(factor: float, times: float | None, cells: int) -> str:
    """Return a sentence on an estimate of the multiple of the loads that the mesh carries.

    Args:
        factor: Factor F that divides the strengths.
        times: The estimate; None if it was not found, ∞ if the multiple seems to be unbounded.
        cells: Number of cells of the mesh.
    """
    carried = f"about {times:.3g} times" if times is not None else "an unknown number of times"
    if times is not None and math.isinf(times):
        carried = "any number of times"
    return (
        f"{cells} cells: with strengths divided by F = {factor:.6g} the mesh carries the loads"
        f" {carried} (an estimate that is not proven)."
    )


def _strict(bounds: BodyBounds) -> tuple[float | None, float | None]:
    """Return the values of both bounds; None for a bound that does not hold for the body."""
    return bounds.lower.strict_value, bounds.upper.strict_value


def _root_of_finest(curves: Sequence[FactorRoots], kind: str, other: str) -> None:
    """Compute the root of one kind of bound on the last mesh that has a root. Collective.

    The last mesh may have no strict bound at any F. Rounding leaves unbalanced forces of 1e-16 of
    the weight, and small cells with almost no cohesion can hardly carry these forces.
    """
    for curve in reversed(curves):
        if curve is not curves[-1] and not curve.is_strict(kind):
            continue
        curve.root(kind, _best(curves, kind)[0], _best(curves, other)[0])
        if curve.shown(kind):
            return


def _better_of(
    one: tuple[float | None, float | None], other: tuple[float | None, float | None]
) -> tuple[float | None, float | None]:
    """Return the larger lower bound and the smaller upper bound; None where both are missing."""
    lowers, uppers = (
        [it for it in pair if it is not None] for pair in zip(one, other, strict=True)
    )
    return max(lowers, default=None), min(uppers, default=None)


def _compute_curves(
    curves: list[FactorRoots], first: FactorRoots, adaptation: Adaptation | None
) -> str:
    """Append the results on each mesh to a list, and return why there is no finer mesh. Collective.

    If the bounds are close enough, the reason is empty, and the caller seeks the roots on the last
    mesh.

    The function seeks F again on each mesh. At a fixed F, a coarse mesh may carry the loads with
    far too small strengths, and would then be refined in the wrong places.

    Args:
        curves: The list, empty at first. The function fills the list during the search, so the
            results remain if the user stops the search.
        first: The search on the first mesh, without results.
        adaptation: Stopping criterion of the refinement; None for the first mesh only.
    """
    problem, tolerance, steps = first.problem, first.tolerance, first.steps
    factor = first.of_mesh()
    if not first.met:
        _check_that_f_matters(problem, first.rtol, steps)
    if adaptation is None:
        first.searches = 2
        bounds = limit_bounds(weakened(problem, factor), first.rtol, steps)
        curves.append(first)
        first.keep(factor, bounds)
        return ""
    adaptation.check(problem.tagged_mesh)
    adaptation.check_design(None)
    problem, gap = with_room_for_stress(problem), None
    while True:
        reduced = weakened(problem, factor)
        try:
            bounds = limit_bounds(reduced, nearness(first.rtol, gap), steps)
        except TooLarge:
            if not curves:
                raise
            return "a finer mesh does not fit into memory"
        curves.append(FactorRoots(problem, tolerance, first.monitor, steps, first.steepness))
        curves[-1].searches = 2
        curves[-1].keep(factor, bounds)
        gap = bounds.lower.apart(bounds.upper)
        if adaptation.ends(bounds.lower, bounds.upper, 1.0):
            return ""
        finer = finer_mesh(reduced, bounds, gap, adaptation, much=True)
        if isinstance(finer, str):
            log.info("F = %.6g: %s", factor, finer)
            return finer
        problem = problem.on(finer)
        factor = next_factor(curves, factor, bounds)


def _check_that_f_matters(
    problem: Problem, rtol: float, steps: Callable[[InteriorStep], None] | None
) -> None:
    """Refuse bodies that fall at any F, or that stand at any F. Collective.

    Raises:
        InputError: If a bound on the first mesh proves one of these cases.
    """
    given = problem.given
    kept = kept_strengths(given.materials, [*given.contacts, *given.obstacles])
    most = upper_bound(weakened(problem, 1 / FAR), rtol, steps).upper.strict_value
    if most is not None and most < 1:
        raise _falls_anyway(kept)
    least = limit_bounds(weakened(problem, FAR), rtol, steps).lower.strict_value
    if least is not None and least >= 1:
        raise _stands_anyway(kept)


def _falls_anyway(kept: Sequence[str]) -> InputError:
    """Return the error for bodies that fall at any F."""
    if kept:
        why = f"{' and '.join(kept)} cannot hold the loads at any F; remove reduced = false there"
    else:
        why = "they tip, or slide without resistance; add supports, or change the loads"
    return InputError(
        f"the bodies collapse even if the strengths that F divides are multiplied by {FAR:g} (F = "
        f"{1 / FAR:g}): {why}."
    )


def _stands_anyway(kept: Sequence[str]) -> InputError:
    """Return the error for bodies that stand almost without the strengths that F divides."""
    limits = " and ".join([*kept, "the supports"])
    return InputError(
        f"the bodies are stable even with F = {FAR:g}: {limits} hold the loads, and the strengths "
        "that F divides do not limit the loads; let a load grow and compute its limit (control = "
        "'bounds'), or let F divide the strengths that hold the bodies."
    )


def _best(curves: Sequence[FactorRoots], kind: str) -> tuple[float | None, BodyBounds | None]:
    """Return the best factor that a strict bound on any mesh proves, and this bound."""
    told = [(F, bounds) for curve in curves for F, bounds in curve.shown(kind).items()]
    if not told:
        return None, None
    return (max if kind == "lower" else min)(told, key=lambda it: it[0])
