"""Compute one or both bounds on the limit load of the body that a mesh fills, on this mesh."""

import logging
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace

import numpy as np

from perfplast_fenicsx.limit_analysis.blocks.rigid_blocks import are_blocks, check_blocks
from perfplast_fenicsx.limit_analysis.body.block_bounds import block_bounds
from perfplast_fenicsx.limit_analysis.body.body_bounds import NOT_SOUGHT, BodyBounds, taken_as
from perfplast_fenicsx.limit_analysis.body.bound_problems import (
    FlowProblem,
    flow_problem,
    is_straight,
    of_displacements,
    of_parents,
    on_parts,
    split_of,
    weaker_and_stronger,
    without_pores,
)
from perfplast_fenicsx.limit_analysis.body.halves import halves_at_once, pays
from perfplast_fenicsx.limit_analysis.body.proof_arrays import proven
from perfplast_fenicsx.limit_analysis.body.singular_points import with_room_for_stress
from perfplast_fenicsx.limit_analysis.conic.conic_program import UNLIMITED, Start
from perfplast_fenicsx.limit_analysis.conic.interior_steps import InteriorStep
from perfplast_fenicsx.limit_analysis.discrete.body_cones import (
    NO_PROOF,
    are_provable,
    body_cones,
    check_cones_are_provable,
)
from perfplast_fenicsx.limit_analysis.discrete.discrete_limit import interior_point
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitLoad, resisted
from perfplast_fenicsx.limit_analysis.discrete.point_strains import forces_of_pairs
from perfplast_fenicsx.limit_analysis.discrete.strength_fields import (
    NOTICED,
    check_cohesion,
    check_profiles,
    held_bodies,
    strong_bodies,
)
from perfplast_fenicsx.limit_analysis.facets.entering import with_strict_contact
from perfplast_fenicsx.limit_analysis.statements.limit_checks import (
    check_bodies_have_limits,
    check_flat_guides,
    check_loads,
    check_tolerance,
)
from perfplast_fenicsx.limit_analysis.statements.load_factor import (
    CONFINED,
    NO_MECHANISM,
    Bound,
    Question,
    Scope,
)
from perfplast_fenicsx.limit_analysis.stress.static_bound import (
    StaticBound,
    bound_by_stress,
    check_straight,
    form_that_fits,
    strict_lower_bound,
)
from perfplast_fenicsx.limit_analysis.velocity.cell_dissipation import (
    MechanismRates,
    mechanism_rates,
)
from perfplast_fenicsx.limit_analysis.velocity.strict_work import (
    gap_shares,
    let_dilate,
    strict_upper_bound,
)
from perfplast_fenicsx.mesh.alfeld_split import AlfeldSplit
from perfplast_fenicsx.outcome_words import percent
from perfplast_fenicsx.problem.declared.loads import check_bounded
from perfplast_fenicsx.problem.problem import Problem

log = logging.getLogger(__name__)

MOST_RESERVE = 0.1
"""Largest share of the strengths that a lower bound with constant loads reserves for rounding."""

MOST_TIMES = 6
"""Largest number of repeated searches for a lower bound, each with a larger reserve."""


def limit_bounds(
    problem: Problem, rtol: float = 1e-4, monitor: Callable[[InteriorStep], None] | None = None
) -> BodyBounds:
    """Return lower and upper bounds on the limit load of the body that the mesh fills. Collective.

    The mechanism of the upper bound preserves the volume everywhere; for this purpose the function
    splits tetrahedra from their centres. In dilating bodies the mechanism dilates enough
    everywhere, because the flow rule is imposed at the vertices. Bodies do not penetrate each other
    between the nodes. The function first divides cells whose stress is over-constrained
    (:func:`singular_points.with_room_for_stress`). At the end the proof checker
    (:mod:`proof.checker`) judges both
    bounds: a bound is strict only as far as the checker proves it.

    Args:
        problem: The bodies and their loads; use quadratic elements, because linear elements lock.
        rtol: Largest relative distance of each bound from the best of its kind on this mesh.
        monitor: Called on every rank after each step.

    Raises:
        InputError: If ``rtol`` is not between 0 and 1, if ζ moves supports or obstacles, or if
            there is no load. If strict bounds do not support a yield set or a load, or if no stress
            can carry the loads. If bodies of revolution dilate and contain pore pressure, or have a
            radial gap between them (:mod:`ring_flux`). If a bound does not fit into memory; the
            memory for the lower bound is checked before any computation.
    """
    problem = admitted(problem, rtol)
    if are_blocks(problem):
        bounds = proven(block_bounds(problem, rtol))
    else:
        bounds = _bounds(*weaker_and_stronger(problem), rtol, monitor)
    return replace(bounds, taken=taken_as(problem))


def check_bounds(problem: Problem, rtol: float = 1e-4) -> None:
    """Check without solving that :func:`limit_bounds` accepts a problem. Collective.

    Args:
        problem: The bodies and their loads.
        rtol: Largest relative distance of each bound from the best of its kind on this mesh.

    Raises:
        InputError: As :func:`limit_bounds`, except for loads that no stress can carry, and for lack
            of memory, because another machine may have enough.
    """
    below, above = weaker_and_stronger(admitted(problem, rtol))
    if above.tagged_mesh.axisymmetric:
        flow_problem(above)
    check_straight(below)


def admitted(problem: Problem, rtol: float) -> Problem:
    """Return the problem in the form in which bounds are computed. Collective.

    The function divides cells whose stress is over-constrained, and removes pore pressures that do
    no work.

    Raises:
        InputError: As :func:`limit_bounds`.
    """
    for load in problem.given.loads:
        check_bounded(load)
    below, above = weaker_and_stronger(problem)
    check_bodies_have_limits(above)
    check_cones_are_provable(above)
    check_tolerance(rtol)
    if problem.tagged_mesh.axisymmetric:
        problem = without_pores(problem, body_cones(above).dilates)
    check_loads(problem)
    check_cohesion(below)
    check_profiles(below)
    check_flat_guides(problem)
    if are_blocks(problem):
        check_blocks(problem)
        return problem
    return with_room_for_stress(problem)


def _bounds(
    below: Problem,
    above: Problem,
    rtol: float,
    monitor: Callable[[InteriorStep], None] | None,
) -> BodyBounds:
    """Return a proven lower bound of one problem and an upper bound of the other. Collective.

    Both problems share one mesh, and in most cases they are identical. With constant loads, the
    checker may refuse a stress only because the stress leaves too little reserve for rounding. The
    function then seeks the stress again with a larger reserve.
    """
    at_once = halves_at_once(below, above, rtol, monitor) if pays(below, above) else None
    if at_once is None:
        with ExitStack() as made:
            form = form_that_fits(below)
            if form is not None:
                made.callback(form.destroy)
            bounds, rates, split = mechanism_bound(above, rtol, monitor)
            log.info("lower bound: a stress on the same cells")
            static = bound_by_stress(below, rtol, monitor, bounds.question, form)
    else:
        bounds, rates, split = _of_flow(at_once.flow, at_once.limit)
        static = at_once.static
        if bounds.question is not at_once.question:
            static = bound_by_stress(below, rtol, monitor, bounds.question, None)
    above_only = bounds

    def judged(static: StaticBound) -> BodyBounds:
        """Return both bounds as the checker proves them. Collective."""
        certificates = {} if static.certificate is None else vars(static.certificate)
        problem, stress, shares = above_only.problem, None, None
        # without a split, the parts of a tetrahedron are not cells of a mesh
        if static.bound.value is not None and (split is not None or problem.bodies.gdim == 2):
            stress = static.stress if split is None else on_parts(static.stress, split)
            if above_only.upper.value is not None:
                shares = gap_shares(problem, above_only.mechanism, stress, rates)
                shares = shares if split is None else of_parents(shares, split)
        found = replace(
            with_displacements(above, above_only),
            lower=static.bound,
            static=static,
            stress=stress,
            shares=shares,
            weaker=None if below is above else _split(below, split),
            certificates={**above_only.certificates, **certificates},
            steps=above_only.steps + len(static.steps),
            factorisations=above_only.factorisations + static.factorisations,
        )
        return proven(found)

    found, reserve = judged(static), Start.within(rtol).reserve
    over = found.lower.over
    for _ in range(MOST_TIMES):
        if found.lower.over <= 1:
            break
        over = min(over, found.lower.over)  # one search may stall far from equilibrium
        reserve = 3 * reserve + 1.5 * (over - 1)
        if not reserve <= MOST_RESERVE:
            break
        log.info("lower bound: next search, with %.2g of the strengths in reserve", reserve)
        found = judged(bound_by_stress(below, rtol, monitor, found.question, None, reserve))
        words = f"the lower bound keeps {percent(reserve)} of the strengths in reserve for rounding"
        if found.lower.strict and reserve > 1e-3:
            found = replace(found, advice=(*found.advice, words))
    return found


def mechanism_bound(
    problem: Problem, rtol: float, monitor: Callable[[InteriorStep], None] | None
) -> tuple[BodyBounds, MechanismRates | None, AlfeldSplit | None]:
    """Return an upper bound without a lower bound. Collective.

    Args:
        problem: See :func:`admitted`.
        rtol: Largest relative distance from the best upper bound on its mesh.
        monitor: Called on every rank after each step.

    Returns:
        The bound (in axisymmetry, of the problem with the unknown v = ru, :mod:`ring_flux`); the
        rates of its mechanism, None without a mechanism; and the mesh of split cells, None without
        a split.
    """
    flow = flow_problem(problem)
    log.info("upper bound: a mechanism on %s", flow.problem)
    return _of_flow(flow, interior_point(with_strict_contact(flow.problem), rtol, monitor))


def _of_flow(
    flow: FlowProblem, limit: LimitLoad
) -> tuple[BodyBounds, MechanismRates | None, AlfeldSplit | None]:
    """Return the results of :func:`mechanism_bound` from a flow problem and its limit load."""
    limit = _with_forces_of_pairs(flow.problem, resisted(limit))
    return *_of_mesh(flow.problem, limit), flow.split


def with_displacements(given: Problem, bounds: BodyBounds) -> BodyBounds:
    """Return bounds whose mechanism is u instead of ru in axisymmetry; other bounds are unchanged.

    Collective.
    """
    if not (given.tagged_mesh.axisymmetric and is_straight(given)):
        return bounds
    flow = bounds.flow
    velocity, mesh = of_displacements(given, flow, bounds.mesh)
    return replace(bounds, problem=given, mechanism=velocity, mesh=mesh, by_flux=flow)


def _with_forces_of_pairs(problem: Problem, limit: LimitLoad) -> LimitLoad:
    """Return a limit load with contact forces of node pairs, or with None for unknown forces.

    Collective.
    """
    forces = None
    if limit.stress is not None and np.isfinite(limit.lower):
        forces = forces_of_pairs(problem, limit.stress, limit.lower)
    elif limit.stress is not None and limit.standing is not None and not problem.loads.grows():
        if limit.standing.lower is not None:
            forces = forces_of_pairs(problem, limit.stress, 0.0, limit.standing.lower)
    return replace(limit, contact_forces=forces)


def _split(problem: Problem, split: AlfeldSplit | None) -> Problem:
    """Return the problem on split cells, if cells are split. Collective."""
    return problem if split is None else problem.on(split)


def bounds_of_mesh(problem: Problem, limit: LimitLoad) -> BodyBounds:
    """Return an upper bound of the body from the mechanism of its mesh's limit load. Collective.

    Args:
        problem: The bodies and their loads.
        limit: Limit load of the interior point method.
    """
    return proven(_of_mesh(problem, limit)[0])


def _of_mesh(problem: Problem, limit: LimitLoad) -> tuple[BodyBounds, MechanismRates | None]:
    """Return an upper bound without a lower bound, and the rates of its mechanism. Collective.

    Instead of rates, the function returns None without a mechanism that may prove a bound.
    """
    rates = None
    certificates = {} if limit.inadmissible is None else {"inadmissible": limit.inadmissible}
    advice: tuple[str, ...] = ()
    question = limit.question
    stands = question is Question.STANDS
    if limit.upper is None and not (stands and limit.collapses):
        dilates = any(on.law.dilates for on in problem.laws)
        why = CONFINED if dilates else NO_MECHANISM
        why = UNLIMITED if limit.reason.startswith(UNLIMITED) else why
        upper = Bound(None, "upper", Scope.MESH, (why,))
        advice = held_bodies(problem)
    elif not are_provable(problem):
        upper = Bound(None, "upper", Scope.MESH, (NO_PROOF,))
    else:
        rates = mechanism_rates(problem, limit.mechanism)
        rates = let_dilate(problem, limit.mechanism, rates)
        upper = strict_upper_bound(problem, limit.mechanism, question=question, rates=rates)
    if upper.of_rounding > NOTICED:
        advice = strong_bodies(problem, upper.of_rounding)
    bounds = BodyBounds(
        problem=problem,
        lower=NOT_SOUGHT,
        upper=upper,
        mechanism=limit.mechanism,
        mesh=limit,
        certificates=certificates,
        steps=limit.iterations,
        factorisations=limit.factorisations or 0,
        advice=advice,
        question=question,
    )
    return bounds, rates


Steps = Callable[[InteriorStep], None]
"""Called on every rank after each step of the interior point method."""


NOT_ASKED = "it was not requested"
"""Reason why a bound that the caller did not request is missing."""


def upper_bound(problem: Problem, rtol: float = 1e-4, steps: Steps | None = None) -> BodyBounds:
    """Return an upper bound and its mechanism, without a lower bound. Collective.

    Args:
        problem: See :func:`limit_bounds.limit_bounds`.
        rtol: Largest relative distance from the best upper bound on its mesh.
        steps: Called after each step.

    Raises:
        InputError: As :func:`limit_bounds.limit_bounds`.
    """
    problem = admitted(problem, rtol)
    _, above = weaker_and_stronger(problem)
    bounds = with_displacements(above, mechanism_bound(above, rtol, steps)[0])
    return proven(replace(bounds, lower=_other("lower"), taken=taken_as(problem)))


def lower_bound(
    problem: Problem, beside: BodyBounds, rtol: float = 1e-4, steps: Steps | None = None
) -> BodyBounds:
    """Return a lower bound and its stress, without an upper bound. Collective.

    Args:
        problem: See :func:`limit_bounds.limit_bounds`.
        beside: Bounds for the same loads, with nearly the same strengths. The result takes their
            mechanism and their question.
        rtol: Largest relative distance from the best lower bound on its mesh.
        steps: Called after each step.

    Raises:
        InputError: As :func:`limit_bounds.limit_bounds`.
    """
    problem = admitted(problem, rtol)
    below, _ = weaker_and_stronger(problem)
    static = strict_lower_bound(below, rtol, steps, beside.question)
    on, stress = below, static.stress if static.bound.value is not None else None
    split = split_of(problem)
    if split is not None:
        on = below.on(split)
        stress = stress if stress is None else on_parts(stress, split)
    elif problem.bodies.gdim == 3:  # without a split, parts of cells are not cells of a mesh
        stress = None
    found = replace(
        beside,
        problem=on,
        lower=static.bound,
        upper=_other("upper"),
        static=static,
        stress=stress,
        shares=None,
        certificates={} if static.certificate is None else vars(static.certificate),
        steps=len(static.steps),
        factorisations=static.factorisations,
        weaker=None,
        taken=taken_as(problem),
    )
    return proven(found)


def _other(kind: str) -> Bound:
    """Return a placeholder for the bound that is not computed."""
    return Bound(None, kind, Scope.MESH, (NOT_ASKED,))
