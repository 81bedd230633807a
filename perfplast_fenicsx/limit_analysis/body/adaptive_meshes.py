"""Bound the largest or the least load factor on meshes that are refined by error indicators.

The gap between the bounds is a sum of non-negative contributions of the cells. Large contributions
show where the mechanism is inaccurate. The dual variables of the lower bound are velocities; their
dissipation shows where the stress is inaccurate. The module refines the cells with the largest
contributions to the gap or to this dissipation. See M. Ciria, J. Peraire and
J. Bonet, doi:10.1002/nme.2310.

The module also bounds the least load factor that the bodies carry, by reversing the live loads.
With constant loads, the load factors that the bodies carry form an interval, because the set of
admissible stresses is convex. The interval need not contain 0: a wall may need the force of a prop.
If the interval does not contain 0, a bound of the largest load factor alone would be misleading.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.limit_analysis.blocks.rigid_blocks import are_blocks
from perfplast_fenicsx.limit_analysis.body.adaptation import Adaptation
from perfplast_fenicsx.limit_analysis.body.block_bounds import block_bounds
from perfplast_fenicsx.limit_analysis.body.body_bounds import BodyBounds, LeastLoad
from perfplast_fenicsx.limit_analysis.body.bound_problems import weaker_and_stronger
from perfplast_fenicsx.limit_analysis.body.finer_meshes import finer_mesh, number_of_cells
from perfplast_fenicsx.limit_analysis.body.limit_bounds import admitted, limit_bounds
from perfplast_fenicsx.limit_analysis.body.singular_points import with_room_for_stress
from perfplast_fenicsx.limit_analysis.conic.interior_steps import StopSearch
from perfplast_fenicsx.limit_analysis.discrete.discrete_limit import InteriorStep
from perfplast_fenicsx.limit_analysis.statements.load_factor import Bound, Question
from perfplast_fenicsx.limit_analysis.stress.static_bound import strict_lower_bound
from perfplast_fenicsx.problem.declared.loads import Bearing, CosinePressure, Load, scaled
from perfplast_fenicsx.problem.problem import Problem, variant
from perfplast_fenicsx.solvers.linear.factorisation import TooLarge
from perfplast_fenicsx.tables import COLOURS, NotebookResult, Row


@dataclass(frozen=True)
class Round:
    """The bounds that were computed on one mesh.

    Attributes:
        number: Number of the mesh, counted from 1.
        cells: Number of cells of the mesh.
        lower: Strict lower bound on this mesh; None if there is no such bound.
        upper: Strict upper bound on this mesh; None if there is no such bound.
        gap: Relative gap between the best strict bounds so far; None if a bound is missing.
        seconds: Wall time so far (s).
        not_proven: Unproven values of the lower and the upper bound. A value is ``None`` if its
            bound is proven or was not found.
    """

    number: int
    cells: int
    lower: float | None
    upper: float | None
    gap: float | None
    seconds: float
    not_proven: tuple[float | None, float | None] = (None, None)


@dataclass(frozen=True)
class AdaptiveBounds(NotebookResult):
    """Bounds on a sequence of meshes.

    Attributes:
        low: Result on the mesh with the best lower bound.
        high: Result on the mesh with the best upper bound.
        last: Result on the last mesh.
        problem: The problem on the last mesh, before its tetrahedra are split.
        sources: The problems on the meshes of ``low`` and ``high``.
        rounds: A report for each mesh.
        reason: Why the sequence ended, and a remedy if there is one, as a clause.
    """

    low: BodyBounds
    high: BodyBounds
    last: BodyBounds
    problem: Problem
    sources: tuple[Problem, Problem]
    rounds: list[Round]
    reason: str

    @property
    def lower(self) -> Bound:
        """Return the best lower bound over all meshes."""
        return self.low.lower

    @property
    def upper(self) -> Bound:
        """Return the best upper bound over all meshes."""
        return self.high.upper

    @property
    def best(self) -> BodyBounds:
        """Return the result on the mesh with the best bounds.

        If the best bounds come from two meshes, return the result of the mesh whose own bounds have
        the smaller gap.
        """
        gaps = [it.lower.apart(it.upper) for it in (self.low, self.high)]
        low, high = (np.inf if gap is None else gap for gap in gaps)
        return self.low if low < high else self.high

    @property
    def body(self) -> BodyBounds:
        """Return the result of :attr:`best`, with the best bounds over all meshes."""
        certificates = dict(self.low.certificates)
        certificates |= {k: v for k, v in self.high.certificates.items() if k == "inadmissible"}
        return replace(
            self.best,
            lower=self.lower,
            upper=self.upper,
            static=self.low.static,
            certificates=certificates,
            advice=self.high.advice,
        )

    def in_words(self) -> str:
        """Return a text of a few sentences about the best bounds."""
        return self.body.in_words()

    def rows(self) -> list[Row]:
        """Return a row for each mesh: fields of :class:`Round`, ``not_proven`` as two columns."""
        rows = [asdict(one) for one in self.rounds]
        for row in rows:
            row["lower, not proven"], row["upper, not proven"] = row.pop("not_proven")
        return rows

    def draw_into(self, axes: Any) -> None:
        """Plot the strict bounds of each mesh over its number of cells."""
        for side in ("lower", "upper"):
            known = [(it.cells, getattr(it, side)) for it in self.rounds]
            cells, values = zip(*known, strict=True)
            numbers = [np.nan if value is None else value for value in values]
            axes.plot(cells, numbers, "o-", color=COLOURS[side], label=f"{side} bound")
        axes.set(xscale="log", xlabel="cells", ylabel="load factor")
        axes.set_title(f"{self.lower.marked} … {self.upper.marked}")
        axes.grid(alpha=0.3)
        axes.legend()

    def __repr__(self) -> str:
        return (
            f"AdaptiveBounds({self.lower!r}, {self.upper!r}; {len(self.rounds)} meshes;"
            f" {self.reason})"
        )


def adaptive_bounds(
    problem: Problem,
    adaptation: Adaptation | None = None,
    rtol: float = 1e-4,
    monitor: Callable[[Round], None] | None = None,
    steps: Callable[[InteriorStep], None] | None = None,
    design: float | None = None,
    so_far: Callable[[AdaptiveBounds], None] | None = None,
) -> AdaptiveBounds:
    """Return bounds on the limit load on successively refined meshes. Collective.

    The refinement ends as ``adaptation`` requires, or if the next mesh does not fit into memory.

    Args:
        problem: The bodies and their loads, on the first mesh.
        adaptation: Stopping criterion of the refinement; by default ``Adaptation()``.
        rtol: Largest relative distance of each bound from the best bound of its kind on its mesh.
            If a twentieth of the gap so far is larger, the function uses this larger value, up to
            2 %.
        monitor: Called on every rank after each mesh.
        steps: Called on every rank after each step of the interior point method.
        design: Load factor of the design load, for ``until = "decided"``.
        so_far: Called on every rank before each mesh except the first, with the bounds so far. The
            caller can, for example, write them to a file.

    Raises:
        InputError: If the mesh cannot be adapted, if the required design load is missing, or if
            :func:`limit_bounds.limit_bounds` refuses the problem.
    """
    adaptation = adaptation or Adaptation()
    adaptation.check(problem.tagged_mesh)
    adaptation.check_design(design)
    problem = problem if are_blocks(problem) else with_room_for_stress(problem)
    began, rounds = time.perf_counter(), list[Round]()
    found = limit_bounds(problem, rtol, steps)
    low = high = found
    of_low = of_high = problem
    try:
        while True:
            gap = low.lower.apart(high.upper)
            seconds = time.perf_counter() - began
            round_ = _round(len(rounds) + 1, problem, found, (low.lower, high.upper), seconds)
            rounds.append(round_)
            if monitor is not None:
                monitor(round_)
            # If the constant loads are bounded, the question is whether the bodies carry them once.
            stands = 1.0 if low.question is Question.STANDS else None
            if ends := adaptation.ends(low.lower, high.upper, stands or design):
                reason = ends
                break
            if found.joints is not None:
                reason = "finer meshes do not improve the bounds of rigid blocks"
                break
            finer = finer_mesh(problem, found, gap, adaptation)
            if isinstance(finer, str):
                reason = finer
                break
            if so_far is not None:
                known = "the next mesh is being solved"
                so_far(AdaptiveBounds(low, high, found, problem, (of_low, of_high), rounds, known))
            finer_problem = problem.on(finer)
            try:
                found = limit_bounds(finer_problem, nearness(rtol, gap), steps)
            except TooLarge as fault:
                reason = f"the next mesh has {number_of_cells(finer)} cells: {fault}".rstrip(".")
                break
            problem = finer_problem
            other = (
                found.question is not low.question
            )  # Bounds for different loads are not comparable.
            if other or found.lower.improves(low.lower):
                low, of_low = found, problem
            if other or found.upper.improves(high.upper):
                high, of_high = found, problem
    except StopSearch as stop:
        reason = "the search on the next mesh was interrupted"
        of_both = (of_low, of_high)
        stop.adapted = AdaptiveBounds(low, high, found, problem, of_both, rounds, reason)
        raise
    return AdaptiveBounds(low, high, found, problem, (of_low, of_high), rounds, reason)


def _round(
    number: int, problem: Problem, found: BodyBounds, best: tuple[Bound, Bound], seconds: float
) -> Round:
    """Return the report on a mesh, with separate proven and unproven results. Collective.

    Args:
        number: Number of the mesh, counted from 1.
        problem: The problem on the mesh.
        found: The result on this mesh.
        best: The best lower and the best upper bound over all meshes so far.
        seconds: Wall time so far (s).
    """
    lower, upper = found.lower, found.upper
    return Round(
        number=number,
        cells=number_of_cells(problem.tagged_mesh),
        lower=lower.strict_value,
        upper=upper.strict_value,
        gap=best[0].apart(best[1]) if best[0].strict and best[1].strict else None,
        seconds=seconds,
        not_proven=(
            None if lower.strict else lower.value,
            None if upper.strict else upper.value,
        ),
    )


def nearness(rtol: float, gap: float | None) -> float:
    """Return the relative tolerance with which bounds on the next mesh are computed.

    Args:
        rtol: Relative tolerance of the bounds.
        gap: Relative gap between the bounds so far; None if a bound is missing.
    """
    share, most = 0.05, 0.02  # fraction of the gap, as a finer mesh at best halves the gap
    return max(rtol, min(share * gap, most)) if gap is not None else rtol


Steps = Callable[[InteriorStep], None]


def best_bounds(
    problem: Problem, adaptation: Adaptation | None, rtol: float, steps: Steps | None
) -> tuple[BodyBounds, BodyBounds]:
    """Return the results with the best lower and with the best upper bound. Collective.

    Args:
        problem: The bodies and their loads.
        adaptation: Adaptation of the mesh; None to use the mesh of the problem.
        rtol: Largest relative distance of each bound from the best bound of its kind on its mesh.
        steps: Called on every rank after each step of the interior point method.
    """
    if adaptation is None:
        found = limit_bounds(problem, rtol, steps)
        return found, found
    adapted = adaptive_bounds(problem, adaptation, rtol, steps=steps)
    return adapted.low, adapted.high


def least_load(
    problem: Problem,
    rtol: float = 1e-4,
    adaptation: Adaptation | None = None,
    steps: Steps | None = None,
) -> LeastLoad:
    """Return bounds of the least load factor that the bodies carry. Collective.

    Args:
        problem: The bodies and their loads.
        rtol: Largest relative distance of each bound from the best bound of its kind on its mesh.
        adaptation: Adaptation of the mesh for the least load factor; None to use the mesh of the
            problem.
        steps: Called on every rank after each step of the interior point method.

    Raises:
        InputError: If a live load is the force of a pin, which cannot pull, or if
            :func:`limit_bounds.limit_bounds` refuses the problem.
    """
    check_turns(problem.given.loads)
    return LeastLoad(*best_bounds(_turned(problem), adaptation, rtol, steps))


def zero_is_outside(problem: Problem, body: BodyBounds, steps: Steps | None = None) -> bool:
    """Return whether the bodies may collapse under the constant loads alone.

    Collective.

    If the strict upper bound in ``body`` is negative, the result is True. Otherwise the function
    seeks a lower bound for the reversed live loads on the mesh of the problem. If there is no lower
    bound of at least 0, the bodies may collapse. The result is False if the question does not
    arise: without constant or live loads, for live loads that cannot be reversed, and if ``body``
    contains no strict bound of a load factor.

    Args:
        problem: The bodies and their loads.
        body: Proven bounds of the largest load factor.
        steps: Called on every rank after each step of the interior point method.
    """
    roughly = 0.1  # Only the sign matters.
    if body.question is not Question.LIMIT or not (body.lower.strict or body.upper.strict):
        return False
    if not (problem.loads.has_dead() and problem.loads.grows()):
        return False
    if any(map(_pushes, problem.given.loads)):
        return False
    if body.upper.strict_value is not None and body.upper.strict_value < 0:
        return True
    turned = admitted(_turned(problem), roughly)
    if are_blocks(turned):
        value = block_bounds(turned, roughly).lower.value
        return value is None or value < 0
    below, _ = weaker_and_stronger(turned)
    value = strict_lower_bound(below, roughly, steps).bound.strict_value
    return value is None or value < 0


def check_turns(loads: Sequence[Load]) -> None:
    """Refuse live loads that cannot be reversed.

    Raises:
        InputError: If a live load cannot be reversed; the message names the first such load.
    """
    for load in filter(_pushes, loads):
        raise InputError(
            f"the load on '{load.on}' is the force of a pin, which cannot pull, so the least load "
            "factor cannot be computed; remove direction = 'both', or give a traction."
        )


def _pushes(load: Load) -> bool:
    return isinstance(load, Bearing | CosinePressure) and not load.constant


def _turned(problem: Problem) -> Problem:
    """Return the problem with the live loads reversed. Collective."""
    loads = [load if load.constant else scaled(load, -1.0) for load in problem.given.loads]
    return variant(problem, loads=loads)
