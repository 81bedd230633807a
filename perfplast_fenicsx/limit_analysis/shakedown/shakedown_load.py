"""Compute the shakedown load for a domain of varying loads, and a Bree diagram of two such loads.

The result holds for the mesh, because the elastic stresses and the equilibrium come from finite
elements. For the bodies, the result is therefore an estimate and not a bound. Stresses satisfy the
yield condition everywhere in each straight quadratic cell (:mod:`elastic_stresses`). If elastic
stresses are infinite, for example at a re-entrant corner, the load tends to zero as the mesh is
refined.

A Bree diagram contains the shakedown loads for all ratios of two varying loads. J. Bree,
Elastic-plastic behaviour of thin tubes subjected to internal pressure and intermittent high-heat
fluxes, Journal of Strain Analysis 2 (1967), 226, gives the diagram of a tube under pressure whose
wall is heated repeatedly.
"""

import math
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any

from mpi4py import MPI

import numpy as np
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.limit_analysis.conic.conic_program import (
    ConicProgram,
    Start,
)
from perfplast_fenicsx.limit_analysis.conic.conic_solver import chosen_conic
from perfplast_fenicsx.limit_analysis.conic.discretisation import (
    NONE,
    Discretisation,
    SingularStiffness,
)
from perfplast_fenicsx.limit_analysis.conic.interior_iteration import InteriorIteration
from perfplast_fenicsx.limit_analysis.conic.interior_steps import (
    InteriorStep,
    Verdict,
    choose_units,
    next_start,
)
from perfplast_fenicsx.limit_analysis.conic.second_order_cones import powers, yield_ratios
from perfplast_fenicsx.limit_analysis.discrete.body_cones import check_whole_cones, whole_cones
from perfplast_fenicsx.limit_analysis.discrete.body_stiffness import ConicStiffness
from perfplast_fenicsx.limit_analysis.discrete.discrete_bounds import kinematic_load, static_load
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitLoad, LimitMethod
from perfplast_fenicsx.limit_analysis.discrete.point_strains import PointStrains
from perfplast_fenicsx.limit_analysis.shakedown.corner_program import CornerStiffness, CornerStrains
from perfplast_fenicsx.limit_analysis.shakedown.elastic_stresses import (
    LoadDomain,
    StressPoints,
    check_names,
    elastic_stresses,
    stress_points,
)
from perfplast_fenicsx.limit_analysis.statements.limit_checks import (
    check_bodies_have_limits,
    check_tolerance,
)
from perfplast_fenicsx.problem.assembled.spaces import by_cell
from perfplast_fenicsx.problem.declared.initial import Temperature
from perfplast_fenicsx.problem.declared.stage import called
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.rounding import TINY
from perfplast_fenicsx.tables import COLOURS, NotebookResult, Row


class Failure(StrEnum):
    """The kind of failure above a shakedown load."""

    ALTERNATING = "alternating plasticity"
    COLLAPSE = "incremental collapse"
    BOTH = "alternating plasticity and incremental collapse at once"
    NONE = "a kind of failure that was not determined"

    @staticmethod
    def of(accumulated: float) -> "Failure":
        """Return the kind of failure, from the share of the flow that remains after a cycle."""
        if accumulated <= 0.05:
            return Failure.ALTERNATING
        return Failure.COLLAPSE if accumulated >= 0.5 else Failure.BOTH


@dataclass(frozen=True, eq=False)
class ShakedownLoad(NotebookResult):
    """The largest multiple of a domain of loads to which the bodies shake down, on this mesh.

    Attributes:
        domain: The domain of the varying loads' factors.
        problem: Problem with the points of the stresses.
        linear: Whether the points are the vertices of cells with linear stresses.
        load: Factor λ from Melan's theorem, an estimate for the bodies; None if no factor was
            found.
        upper: Factor from Koiter's theorem, which differs from ``load`` by at most the tolerance
            after convergence.
        over: Largest yield ratio over all corners and points, 1 up to rounding.
        unbalanced: Largest unbalanced force of the residual stress, relative to the largest load.
        first_yield: Factor of the domain at which the first point yields at a corner, without
            residual stress; None with constant loads.
        accumulated: Share of the plastic flow in a cycle that remains at the end of the cycle.
        failure: Kind of failure above the load.
        mechanism: Displacement that remains after a cycle, up to a factor.
        dissipation: Dissipation of a cycle at the points, up to the same factor.
        residual: Residual stress ρ, Mandel vectors at the points (stress).
        steps: Number of steps of the interior point method.
        factorisations: Total number of factorisations.
        linear_solves: Total number of linear solves.
        converged: Whether the static and the kinematic value agree to the tolerance.
        reason: Reason for the end of the search.
    """

    domain: LoadDomain
    problem: Problem
    linear: bool
    load: float | None
    upper: float | None
    over: float
    unbalanced: float
    first_yield: float | None
    accumulated: float
    failure: Failure
    mechanism: fem.Function
    dissipation: fem.Function
    residual: fem.Function
    steps: int
    factorisations: int
    linear_solves: int
    converged: bool
    reason: str

    def in_words(self) -> str:
        """Return the result in a sentence."""
        if self.load is None or not self.converged:
            return f"No shakedown load was found: {self.reason}."
        words = (
            f"Shakedown to {self.load:.5g} times the load domain (an estimate: the elastic"
            f" stresses are those of this mesh); above that, {self.failure}"
        )
        if self.first_yield is not None:
            words += f". The first point yields at {self.first_yield:.5g} times the load domain"
        return f"{words}."

    def rows(self) -> list[Row]:
        """Return a row for each corner: the factors of the domain, and the factors at shakedown."""
        names, found = self.domain.names, self.load if self.converged else None
        rows: list[Row] = []
        for corner in self.domain.corners:
            row: Row = dict(zip(names, map(float, corner), strict=True))
            for name in names:
                row[f"{name} at shakedown"] = None if found is None else found * row[name]
            rows.append(row)
        return rows

    def draw_into(self, axes: Any) -> None:
        """Draw the domain of the loads, and the multiple to which the bodies shake down.

        Raises:
            InputError: If more than two loads vary.
        """
        names, corners = self.domain.names, self.domain.corners
        if len(names) > 2:
            raise InputError(
                f"plot draws domains of one or two loads, but {len(names)} loads vary; "
                "to_dataframe() returns all corners."
            )
        flat = np.column_stack([corners, np.zeros(len(corners))])[:, :2]
        turn = np.arctan2(*(flat - flat.mean(axis=0)).T[::-1])
        around = flat[np.append(np.argsort(turn), np.argmin(turn))]
        axes.plot(*around.T, "o-", color="#555555", label="load domain")
        if self.converged and self.load is not None:
            label = f"shakedown: {self.load:.5g} times (estimate)"
            axes.plot(*(self.load * around).T, "o-", color=COLOURS["lower"], label=label)
        axes.set(**dict(zip(("xlabel", "ylabel"), (f"times {it}" for it in names), strict=False)))
        axes.grid(alpha=0.3)
        axes.legend()

    def as_limit(self) -> LimitLoad:
        """Return the result in the form of a limit load, for files and pictures."""
        return LimitLoad(
            method=LimitMethod.INTERIOR_POINT,
            lower=self.load if self.converged and self.load is not None else -math.inf,
            estimate=self.load if self.converged else None,
            residual=None,
            upper=self.upper if self.converged else None,
            alpha=None,
            levelled_off=self.converged,
            reason=self.reason,
            iterations=self.steps,
            linear_solves=self.linear_solves,
            factorisations=self.factorisations,
            mechanism=self.mechanism,
        )

    def of_cells(self) -> fem.Function:
        """Return the dissipation of a cycle, averaged over each cell. Collective."""
        cells = fem.functionspace(self.problem.tagged_mesh.mesh, ("DG", 0))
        mean = fem.Function(cells, name="dissipation")
        mean.x.array[:] = by_cell(self.dissipation).mean(axis=1)
        return mean

    def table(self) -> dict[str, Any]:
        """Return the table for ``summary.json``."""
        return {
            "names": self.domain.names,
            "corners": self.domain.corners.tolist(),
            "load": self.load if self.converged else None,
            "koiter": self.upper if self.converged else None,
            "stress_over_yield": self.over if self.converged else None,
            "unbalanced": self.unbalanced if self.converged else None,
            "first_yield": self.first_yield,
            "accumulated": self.accumulated if self.converged else None,
            "failure": str(self.failure),
            "within_cells": self.linear,
            "in_words": self.in_words(),
        }

    def __repr__(self) -> str:
        return f"ShakedownLoad({self.load}, {self.failure})"


def shakedown_load(
    problem: Problem,
    domain: LoadDomain,
    rtol: float = 1e-4,
    monitor: Callable[[InteriorStep], None] | None = None,
) -> ShakedownLoad:
    """Return the largest λ such that the bodies shake down to λ times a domain. Collective.

    Args:
        problem: The bodies and their loads; constant loads act all the time.
        domain: Factors of the varying loads and temperatures.
        rtol: Largest relative difference between the static and the kinematic value.
        monitor: Called on every rank after each step.

    Raises:
        InputError: If ``rtol`` is not between 0 and 1, if bodies harden or are in contact, if a
            name is unknown, if a growing load is not in the domain, if supports move, if a law has
            no suitable cone, or if no varying load causes stress in a body that can yield.
    """
    check_shakedown(problem, domain, rtol)
    points = stress_points(problem)
    with ExitStack() as made:
        strains = PointStrains(points.working, whole_cones(problem))
        made.callback(strains.destroy)
        each, dead = elastic_stresses(problem, domain.names, points, strains)
        live = np.einsum("cn,npi->cpi", np.unique(domain.corners, axis=0), each)
        varying = Varying(domain, points, strains, live, dead)
        if not varying.causes_stress():
            raise InputError(
                "no varying load causes stress in a body that can yield, so nothing limits the "
                "loads; give a yield stress to a loaded body, or give a load that is not zero."
            )
        found, start = _search(varying, rtol, monitor, Start.within(rtol))
        while start is not None:
            before = found
            found, start = _search(varying, rtol, monitor, start)
            found = _with_costs_of(before, found)
        if not found.converged:
            found = _explained(found, varying, rtol, monitor)
    ones = len(domain.names) + 1
    return replace(
        found,
        factorisations=found.factorisations + 1,  # including the one for the elastic stresses
        linear_solves=found.linear_solves + ones,
    )


def check_shakedown(problem: Problem, domain: LoadDomain, rtol: float = 1e-4) -> None:
    """Check without solving that :func:`shakedown_load` accepts a problem. Collective.

    Args:
        problem: The bodies.
        domain: Factors of varying loads and temperatures.
        rtol: Largest relative difference between the static and the kinematic value.

    Raises:
        InputError: In the cases of :func:`shakedown_load`, except if the loads cause no stress in a
            body that can yield.
    """
    check_tolerance(rtol)
    check_bodies_have_limits(problem)
    if problem.num_pairs or problem.friction.count:
        raise InputError(
            "shakedown superposes the elastic stresses of the separate loads, so bodies may "
            "neither separate nor slide; use [[tie]] tables in place of contacts that stay closed."
        )
    if problem.motion.moves_supports or problem.motion.driven:
        raise InputError(
            "shakedown supports only loads and temperatures, but a support or a rigid surface"
            " moves; remove this motion."
        )
    warmed = [called(a) for a in problem.given.initial if isinstance(a, Temperature)]
    check_names(problem.given.loads, warmed, domain.names)
    check_whole_cones(problem)


@dataclass(frozen=True, eq=False)
class Varying:
    """The points of the bodies, and the elastic stresses from varying and constant loads.

    Attributes:
        domain: Factors of varying loads and temperatures.
        points: Points of the stresses.
        working: Strain rates at the points at which stresses do work.
        live: Elastic stresses at the corners, Mandel vectors, shape (num_corners, count, m).
        dead: Elastic stress from constant loads, shape (count, m).
    """

    domain: LoadDomain
    points: StressPoints
    working: PointStrains
    live: Floats
    dead: Floats

    def program(self, reserve: float) -> tuple[CornerStrains, ConicProgram]:
        """Return the strain rates at the corners, and the conic program. Collective.

        Args:
            reserve: See :class:`ConicProgram`.
        """
        problem = self.points.working
        strains = CornerStrains(problem, self.working, len(self.live))
        stiffness = CornerStiffness(ConicStiffness(problem, self.working), strains)
        live, dead, free = (strains.create_vector() for _ in range(3))
        for stress, forces in ((self.live, live), (0 * self.live + self.dead, dead)):
            strains.forces(*strains.coordinates(stress), forces)
        on = Discretisation(problem.comm, strains, stiffness, live, dead, free, NONE)
        return strains, ConicProgram(on, reserve)

    def causes_stress(self) -> bool:
        """Return whether a varying load causes stress in a body that can yield. Collective."""
        strains = CornerStrains(self.points.working, self.working, len(self.live))
        loaded = self.ratio(strains, self.live) > 0
        strains.destroy()
        return loaded

    def ratio(self, strains: CornerStrains, stresses: Floats) -> float:
        """Return the largest yield ratio of stresses. Collective.

        Args:
            strains: Cones at points and corners.
            stresses: Mandel vectors, shape (num_corners, count, m).
        """
        ratios = yield_ratios(strains, *strains.coordinates(stresses))
        worst = float(ratios.max(initial=0.0))
        return float(self.points.known.comm.allreduce(worst, MPI.MAX))


def _explained(
    found: ShakedownLoad,
    varying: Varying,
    rtol: float,
    monitor: Callable[[InteriorStep], None] | None,
) -> ShakedownLoad:
    """Return a failed result, whose reason says if the constant loads are too large. Collective."""
    alone = replace(varying, live=varying.dead[None], dead=np.zeros_like(varying.dead))
    if not alone.causes_stress():
        return found
    multiple, _ = _search(alone, rtol, monitor, Start.within(rtol))
    if multiple.converged and multiple.upper is not None and multiple.upper < 1:
        reason = (
            f"on this mesh, the bodies carry about {multiple.upper:.5g} times the constant loads"
        )
        found = replace(found, reason=reason)
    return _with_costs_of(multiple, found)


def _with_costs_of(other: ShakedownLoad, found: ShakedownLoad) -> ShakedownLoad:
    """Return a result whose counts include those of another search."""
    return replace(
        found,
        steps=other.steps + found.steps,
        factorisations=other.factorisations + found.factorisations,
        linear_solves=other.linear_solves + found.linear_solves,
    )


def _search(
    varying: Varying,
    rtol: float,
    monitor: Callable[[InteriorStep], None] | None,
    start: Start,
) -> tuple[ShakedownLoad, Start | None]:
    """Search from a start; return the result, and the next start or None. Collective."""
    with ExitStack() as made:
        strains, program = varying.program(start.reserve)
        made.callback(program.destroy)
        steps: list[InteriorStep] = []
        iteration: InteriorIteration | None = None
        try:
            verdict, reason = Verdict.UNBOUNDED, "nothing limits the varying loads, up to rounding"
            if choose_units(program, start):
                iteration = InteriorIteration(program)
                made.callback(iteration.destroy)
                verdict, reason = chosen_conic()(iteration, rtol, steps, monitor)
        except SingularStiffness as failure:
            verdict, reason = Verdict.STALLED, str(failure)
        now = None if iteration is None else iteration.now
        then = next_start(start, program, now, verdict, rtol)
        found = _found(varying, strains, program, iteration, (verdict, reason, len(steps)))
        return found, then


def _found(
    varying: Varying,
    strains: CornerStrains,
    program: ConicProgram,
    iteration: InteriorIteration | None,
    ended: tuple[Verdict, str, int],
) -> ShakedownLoad:
    """Return the shakedown load of an iteration, in the user's units. Collective."""
    verdict, reason, steps = ended
    problem = varying.points.known
    mechanism = fem.Function(problem.V, name="mechanism")
    dissipation, residual = fem.Function(problem.Q), fem.Function(problem.S)
    load = upper = None
    unbalanced, over, share = np.inf, np.inf, 0.0
    if iteration is not None:
        estimate = (iteration.now.load + iteration.gap()) * program.load_unit
        iterate = iteration.now
        low = static_load(iteration)
        load, unbalanced = low.value, low.unbalanced
        if load is not None:
            whole = program.whole(iteration.now.stress, iteration.now.load)
            stress = program.stress_unit * strains.stresses(*whole)[0]
            scale = load / (iteration.now.load * program.load_unit)
            rest = scale * stress - load * varying.live[0] - varying.dead
            _set(residual, rest)
            over = varying.ratio(strains, load * varying.live + varying.dead + rest)
        iteration.now = iterate
        high = kinematic_load(iteration)
        upper = estimate if high.value is None else high.value
        velocity = iteration.velocity
        velocity.scale(1 / program.work(velocity))
        problem.basis.T.mult(strains.velocity(velocity), mechanism.x.petsc_vec)
        mechanism.x.scatter_forward()
        flows = strains.flows(velocity)
        share = _accumulated(varying, strains, flows)
        power = powers(strains, *strains.of(velocity)).reshape(strains.corners, -1).sum(axis=0)
        _set(dissipation, power)
    converged = verdict is Verdict.FOUND and load is not None
    if load is not None and not load > 0:
        converged, reason = False, "the bodies cannot carry the constant loads alone"
    first = None if program.has_dead else 1 / varying.ratio(strains, varying.live)
    return ShakedownLoad(
        domain=varying.domain,
        problem=problem,
        linear=varying.points.linear,
        load=load,
        upper=None if upper is None else float(upper),
        over=over,
        unbalanced=unbalanced,
        first_yield=first,
        accumulated=share,
        failure=Failure.of(share) if converged else Failure.NONE,
        mechanism=mechanism,
        dissipation=dissipation,
        residual=residual,
        steps=steps,
        factorisations=program.stiffness.counts.factorisations,
        linear_solves=program.stiffness.counts.solves,
        converged=converged,
        reason=reason,
    )


def _accumulated(varying: Varying, strains: CornerStrains, flows: Floats) -> float:
    """Return the share of the flow in a cycle that remains at the end of the cycle. Collective.

    The share is 0 for alternating plasticity, and 1 if each point flows only at one corner.
    """
    tensors, weights = strains.tensors(flows), strains.points.weights
    left = weights @ np.linalg.norm(tensors.sum(axis=0), axis=1)
    whole = weights @ np.linalg.norm(tensors, axis=2).sum(axis=0)
    sums = varying.points.known.comm.allreduce(np.array([left, whole]))
    return float(sums[0] / max(sums[1], TINY))


def _set(function: fem.Function, values: Floats) -> None:
    """Set the values of a function at the points. Collective."""
    function.x.array[: values.size] = values.ravel()
    function.x.scatter_forward()


@dataclass(frozen=True)
class Direction:
    """The shakedown load for one ratio of two varying loads.

    Attributes:
        angle: Arc tangent of the ratio of the second load to the first (degrees), each relative to
            its shakedown load without the other; 0 if only the first load varies.
        first: Factor of the first load at the shakedown limit; None if no limit was found.
        second: Factor of the second load at the shakedown limit; None if no limit was found.
        failure: Kind of failure beyond the limit.
    """

    angle: float
    first: float | None
    second: float | None
    failure: str


def check_directions(domain: LoadDomain, directions: int) -> None:
    """Check that a domain and a number of directions suit a diagram; 0 means no diagram.

    Raises:
        InputError: If the domain does not have two varying loads, or if there are too few
            directions.
    """
    if directions and (directions < 3 or len(domain.names) != 2):
        raise InputError(
            f"directions = {directions}, and the number of varying loads is {len(domain.names)}, "
            "but a diagram needs at least 3 directions and exactly two varying loads; correct "
            "this, or remove directions."
        )


def shakedown_diagram(
    problem: Problem,
    domain: LoadDomain,
    directions: int = 13,
    rtol: float = 1e-4,
    monitor: Callable[[Direction], None] | None = None,
    steps: Callable[[InteriorStep], None] | None = None,
) -> list[Direction]:
    """Return the shakedown loads for evenly spaced ratios of two varying loads. Collective.

    Args:
        problem: The bodies.
        domain: Domain with two names; each direction scales the factors of both.
        directions: Number of directions in a quarter circle, including both axes.
        rtol: As for :func:`shakedown_load`.
        monitor: Called on every rank after each direction.
        steps: Called on every rank after each step of the interior point method.

    Raises:
        InputError: If :func:`shakedown_load` refuses the problem, if the domain does not have two
            names, or if there are too few directions.
    """
    check_directions(domain, directions)
    told = (problem, domain, rtol, steps)
    ends = [_at(angle, axis, *told) for angle, axis in ((0.0, (1.0, 0.0)), (90.0, (0.0, 1.0)))]
    one, other = ends[0].first or 1.0, ends[1].second or 1.0
    found = []
    for number, angle in enumerate(np.linspace(0.0, 90.0, directions)):
        between = 0 < number < directions - 1
        ray = (one * math.cos(math.radians(angle)), other * math.sin(math.radians(angle)))
        found.append(_at(float(angle), ray, *told) if between else ends[number > 0])
        if monitor is not None:
            monitor(found[-1])
    return found


def _at(
    angle: float,
    ray: tuple[float, float],
    problem: Problem,
    domain: LoadDomain,
    rtol: float,
    steps: Callable[[InteriorStep], None] | None,
) -> Direction:
    """Return the shakedown load along a ray. Collective."""
    along = replace(domain, corners=domain.corners * np.array(ray))
    found = shakedown_load(problem, along, rtol, steps)
    first, second = None, None
    if found.converged and found.load is not None:
        first, second = (found.load * part for part in ray)
    return Direction(angle, first, second, str(found.failure))
