"""Compute the limit load of the discrete problem by an interior point method, without a path.

The static and the kinematic load converge to each other in 5 to 30 factorisations, for any mesh.
Both bound the limit load of the *discrete* problem: finite elements in equilibrium, with yield and
dissipation at the quadrature points.

The module also identifies bodies that lock because no velocity on their mesh preserves volume. Few
quadratic velocities on arbitrary tetrahedra preserve the volume at all points. The volume changes
of the projected velocity show the bodies whose mesh is too coarse for a mechanism.

The module also computes Drucker's bounds on the limit load with Coulomb's friction. No limit
theorem holds for Coulomb's friction, because slip is not normal to the friction cone. However, the
load at collapse is at least the limit load without friction, and at most the limit load of bodies
whose surfaces with friction can neither slip nor separate. Both bounds are limit loads in perfect
plasticity (D. C. Drucker, Coulomb friction, plasticity, and limit loads, J. Appl. Mech. 21 (1954),
71).
"""

import math
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import partial

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.conic.conic_program import (
    UNLIMITED,
    ConicProgram,
    Start,
)
from perfplast_fenicsx.limit_analysis.conic.conic_solver import chosen_conic
from perfplast_fenicsx.limit_analysis.conic.discretisation import (
    Discretisation,
    SingularStiffness,
    Stiffness,
    Strains,
)
from perfplast_fenicsx.limit_analysis.conic.interior_iteration import InteriorIteration
from perfplast_fenicsx.limit_analysis.conic.interior_steps import (
    InteriorStep,
    StopSearch,
    Verdict,
    choose_units,
    next_start,
)
from perfplast_fenicsx.limit_analysis.discrete.body_stiffness import ConicStiffness
from perfplast_fenicsx.limit_analysis.discrete.discrete_bounds import (
    IN_BALANCE,
    kinematic_load,
    static_load,
)
from perfplast_fenicsx.limit_analysis.discrete.friction_points import (
    FrictionStiffness,
    FrictionStrains,
    SlipPlaces,
)
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitLoad, LimitMethod
from perfplast_fenicsx.limit_analysis.discrete.point_strains import PointCoordinates, PointStrains
from perfplast_fenicsx.limit_analysis.statements.limit_checks import (
    check_bodies_have_limits,
    check_friction_has_limits,
    check_loads,
    check_tolerance,
)
from perfplast_fenicsx.limit_analysis.statements.load_factor import (
    DruckerBounds,
    Question,
    Standing,
)
from perfplast_fenicsx.outcome_words import percent
from perfplast_fenicsx.problem.problem import Problem, variant

MOST = 0.9
"""Share of the inadmissible part in the bodies that :func:`locking_bodies` returns together."""


def locking_bodies(problem: Problem, iteration: InteriorIteration) -> tuple[str, ...]:
    """Return the bodies with most of the inadmissible part of a velocity. Collective.

    Args:
        problem: The bodies.
        iteration: The iteration with the velocity after the projection.

    Returns:
        Names of volumes, in descending order of their shares; empty if the velocity is admissible.
    """
    program, tagged_mesh = iteration.program, problem.tagged_mesh
    trace, deviator = program.strains.of(iteration.velocity)
    wrong = trace**2 / program.strains.gdim
    wrong += np.where(program.plastic, 0.0, np.einsum("ni,ni->n", deviator, deviator))
    wrong *= program.weights  # friction points follow the points of cells
    owned = tagged_mesh.mesh.topology.index_map(problem.bodies.gdim).size_local
    cells = wrong[problem.Q.dofmap.list[:owned]].sum(axis=1)
    names = sorted(tagged_mesh.volumes)
    mine = [cells[here[here < owned]].sum() for here in map(tagged_mesh.cells, names)]
    shares = problem.comm.allreduce(np.asarray(mine, dtype=np.float64))
    return _largest(names, shares)


def _largest(names: Sequence[str], shares: npt.ArrayLike) -> tuple[str, ...]:
    """Return the fewest names with :data:`MOST` of the sum of all shares, in descending order."""
    order = np.argsort(-np.asarray(shares), kind="stable")
    sums = np.cumsum(np.asarray(shares)[order])
    if not 0 < sums[-1] < np.inf:
        return ()
    return tuple(names[i] for i in order[: 1 + np.searchsorted(sums, MOST * sums[-1])])


def why_unbounded(problem: Problem) -> str:
    """Return the likely reason why there is no mechanism."""
    if any(on.law.dilates for on in problem.laws):
        return (
            "bodies that dilate in plastic flow may be confined and then carry any load, or"
            " elements may lock; give the bodies room to dilate, or use quadratic elements"
        )
    if problem.degree == 1:
        return (
            "linear elements may lock, because plastic flow preserves volume (use quadratic"
            " elements: degree = 2 under [element]), or bodies that do not yield carry the loads"
        )
    return "bodies that do not yield, or that cannot flow, carry the loads"


def _remedy(problem: Problem) -> str:
    """Return a remedy for a mesh without an admissible mechanism."""
    if problem.degree == 1:
        return (
            "perhaps because linear elements lock; use quadratic elements (degree = 2 under "
            "[element])"
        )
    return "but there may be one on a finer mesh"


def discrete_result(
    problem: Problem,
    program: ConicProgram,
    iteration: InteriorIteration | None,
    verdict: Verdict,
    reason: str,
    steps: list[InteriorStep],
    rtol: float,
    question: Question,
) -> LimitLoad:
    """Return the limit load of an iterate, with bounds computed from its fields. Collective.

    In the result, ``lower`` is the load of a stress, or −∞. Without constant loads, the caller
    replaces a negative ``lower`` by 0.
    """
    mechanism = fem.Function(problem.V, name="mechanism")
    stress = fem.Function(problem.S, name="stress")
    forces: Floats = np.zeros(len(problem.basis.gap))
    lower = upper = estimate = None
    unbalanced = inadmissible = np.inf
    locked: tuple[str, ...] = ()
    if iteration is not None and steps:
        kinematic = (iteration.now.load + iteration.gap()) * program.load_unit
        power = (iteration.size() + iteration.gap()) * program.load_unit
        iterate = iteration.now
        low = static_load(iteration)
        lower, unbalanced = low.value, low.unbalanced
        if lower is None and verdict is Verdict.FOUND:
            reason += "; no admissible stress balances the loads, so there is no lower"
            reason += " value"
        _write_stress(problem, iteration, stress)
        forces = iteration.now.forces * program.force_unit
        if verdict in (Verdict.FOUND, Verdict.STALLED):
            iteration.now = iterate  # restores the contact forces from before the balancing
            high = kinematic_load(iteration)
            upper, inadmissible = high.value, high.inadmissible
            if upper is None:
                locked = locking_bodies(problem, iteration)
                reason += f"; no admissible mechanism was found, {_remedy(problem)}"
                # Largest inadmissible part after the projection with which a mechanism still gives
                # an estimate.
                nearly = 1e-6
                verdict = verdict if inadmissible <= nearly else Verdict.STALLED
        if verdict is Verdict.FOUND or upper is not None:
            _write_mechanism(problem, iteration, question, mechanism)
        size = high.size if program.has_dead and upper is not None else abs(lower or 0.0)
        if lower is not None and upper is not None and size > 0:
            apart = f"static and kinematic load are {percent(abs(upper - lower) / size)} apart"
            if verdict is Verdict.STALLED:
                estimate = (lower + upper) / 2
                verdict = Verdict.FOUND if upper - lower <= rtol * size else verdict
            reason = apart if verdict is Verdict.FOUND else f"{reason}; {apart}"
        if verdict is Verdict.FOUND and estimate is None:
            # Largest excess of a useful upper bound over the last kinematic load, relative to the
            # dissipation. Rounding in bodies that are too strong to flow causes larger excesses.
            polluted = 0.01
            useful = upper is not None and upper <= kinematic + polluted * power
            known = [bound for bound in (lower, upper if useful else None) if bound is not None]
            estimate = sum(known) / len(known) if known else steps[-1].load
    return LimitLoad(
        method=LimitMethod.INTERIOR_POINT,
        lower=-np.inf if lower is None else lower,
        estimate=estimate,
        residual=None,
        upper=upper,
        alpha=None,
        levelled_off=verdict is Verdict.FOUND,
        reason=reason,
        iterations=len(steps),
        linear_solves=program.stiffness.counts.solves,
        factorisations=program.stiffness.counts.factorisations,
        mechanism=mechanism,
        stress=stress,
        contact_forces=forces,
        unbalanced=unbalanced,
        inadmissible=inadmissible,
        verdict=verdict,
        steps=steps,
        locked=locked,
    )


def _write_mechanism(
    problem: Problem, iteration: InteriorIteration, question: Question, mechanism: fem.Function
) -> None:
    """Write the velocity into a function of V, scaled so that the loads do the work 1.

    Collective.
    """
    problem.basis.T.mult(iteration.velocity, mechanism.x.petsc_vec)
    mechanism.x.scatter_forward()
    load, _, _ = question.loads(problem.loads.live, problem.loads.dead)
    mechanism.x.array[:] /= float(load.dot(mechanism.x.petsc_vec))


def _write_stress(problem: Problem, iteration: InteriorIteration, function: fem.Function) -> None:
    """Write the stress of the iterate into a function of S. Collective."""
    now = iteration.now
    pressure, deviator = iteration.program.whole(now.stress, now.load)
    count = problem.Q.dofmap.index_map.size_local  # friction points follow these points
    found = PointCoordinates(problem).whole(pressure[:count], deviator[:count])
    function.x.array[: found.size] = iteration.program.stress_unit * found.ravel()
    function.x.scatter_forward()


def limit_program(problem: Problem, question: Question, reserve: float) -> ConicProgram:
    """Return the conic program of a problem's limit load. Collective.

    Args:
        problem: The bodies and their loads.
        question: The loads whose factor is sought.
        reserve: See :class:`ConicProgram`.
    """
    points = PointStrains(problem)
    bodies = ConicStiffness(problem, points)
    strains: Strains = points
    stiffness: Stiffness = bodies
    if problem.friction.count:
        strains = both = FrictionStrains(points, SlipPlaces.of(problem.friction))
        stiffness = FrictionStiffness(bodies, both, points.count)
    live, dead = problem.create_vector(), problem.create_vector()
    problem.basis.T.multTranspose(problem.loads.live, live)
    problem.basis.T.multTranspose(problem.loads.dead, dead)
    loads = question.loads(live, dead)
    return ConicProgram(
        Discretisation(problem.comm, strains, stiffness, *loads, jumps=problem.basis.index),
        reserve,
    )


def interior_point(
    problem: Problem, rtol: float = 1e-4, monitor: Callable[[InteriorStep], None] | None = None
) -> LimitLoad:
    """Return the discrete limit load with its mechanism and its stress. Collective.

    Args:
        problem: The bodies and their loads.
        rtol: Largest relative difference of the bounds.
        monitor: Called on every rank after each step.

    Raises:
        InputError: If ``rtol`` is not between 0 and 1, if supports move, if there are no loads, if
            no limit theorem holds for a body or for friction, or if the method does not support a
            body's yield set (:mod:`body_cones`).
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
    """Return the result; without constant loads, its lower bound is at least 0."""
    return found if problem.loads.has_dead() else replace(found, lower=max(found.lower, 0.0))


def _searched(
    problem: Problem,
    rtol: float,
    monitor: Callable[[InteriorStep], None] | None,
    question: Question,
) -> LimitLoad:
    """Return the best result of a search and of its repetitions from other starts.

    Collective.
    """
    found, start = _search(problem, rtol, monitor, Start.within(rtol), question)
    while start is not None:
        other, start = _search(problem, rtol, monitor, start, question)
        found = _together(found, other)
    return found


def _with_standing(found: LimitLoad, stands: LimitLoad) -> LimitLoad:
    """Return the result with the multiple of the constant loads that the bodies can carry.

    If the bodies cannot carry the constant loads, the result is this multiple only.
    """
    told = _of_dead_loads(stands)
    standing = told.standing
    if standing is not None and not standing.falls:
        reason = f"{found.reason}; {standing.in_words()}"
        told = replace(found, standing=standing, reason=reason)
    return _of_both(told, found, stands)


def _of_dead_loads(stands: LimitLoad) -> LimitLoad:
    """Return the result as a multiple of the constant loads, without a load factor."""
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
    """Return a result with the steps and solves of both searches."""
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
    """Search from a start; return the result, and the next start or None. Collective."""
    with ExitStack() as made:
        program = limit_program(problem, question, start.reserve)
        made.callback(program.destroy)
        steps: list[InteriorStep] = []
        result = partial(
            discrete_result, problem, program, steps=steps, rtol=rtol, question=question
        )
        if program.degree == program.num_pairs:
            reason = (
                "nothing can yield; give the bodies that may collapse a yield stress, or ask for "
                "bounds of blocks that collapse at their joints (control = 'bounds')"
            )
            return result(None, Verdict.UNBOUNDED, reason), None
        verdict, reason = Verdict.UNBOUNDED, UNLIMITED
        if problem.degree == 1:
            reason += (
                "; locking of linear elements has the same effect: use quadratic elements "
                "(degree = 2 under [element])"
            )
        try:
            limited = choose_units(program, start)
        except SingularStiffness as failure:
            limited, verdict, reason = False, Verdict.STALLED, str(failure)
        if not limited:
            found = result(None, verdict, reason)
            return found, next_start(start, program, None, verdict, rtol)
        iteration = InteriorIteration(program)
        made.callback(iteration.destroy)
        # The steps end at this share of rtol. The remaining share allows for an increase of the
        # upper bound by the projection that makes the mechanism exactly admissible.
        closer = 0.1
        try:
            verdict, reason = chosen_conic()(
                iteration, rtol, steps, monitor, closer, question.enough
            )
        except StopSearch as stop:
            reason = f"the search was stopped after {len(steps)} steps"
            stop.found = result(iteration, Verdict.STALLED, reason)
            raise
        if verdict is Verdict.UNBOUNDED:
            reason += f": {why_unbounded(problem)}"
        then = next_start(start, program, iteration.now, verdict, rtol)
        found = result(iteration, verdict, reason)
        over = not np.isfinite(found.lower) and found.unbalanced <= IN_BALANCE
        if program.keeps and verdict is Verdict.FOUND and over:
            then = start.with_more_in_reserve()
        return found, then


def drucker_bounds(problem: Problem) -> DruckerBounds:
    """Return Drucker's two bounds on the limit load with Coulomb's friction. Collective.

    Raises:
        InputError: If :func:`interior_point` refuses the problem.
    """
    smooth = interior_point(variant(problem, friction=problem.friction.smooth()))
    tied = interior_point(without_slip(problem))
    carried = 0.0 if smooth.verdict is Verdict.NO_RESISTANCE else max(smooth.lower, 0.0)
    known: dict[Verdict | None, float] = {Verdict.UNBOUNDED: math.inf, Verdict.NO_RESISTANCE: 0.0}
    return DruckerBounds(carried, known.get(tied.verdict, tied.upper))


def without_slip(problem: Problem) -> Problem:
    """Return a copy of the problem in which surfaces with friction are tied. Collective."""
    basis, friction = problem.basis, problem.friction
    parts = np.ones(len(basis.index), dtype=np.bool_)
    parts[friction.pair] = False
    held = np.concatenate([basis.tied, basis.index[~parts], basis.sliding])
    none = np.zeros(0, dtype=np.int32)
    glued = replace(basis.holding(held, parts), sliding=none)
    return variant(problem, basis=glued, friction=friction.nowhere())
