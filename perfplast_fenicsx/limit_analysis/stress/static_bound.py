"""Compute a lower bound of the body's limit load: a stress in equilibrium everywhere.

The stress is linear in each cell (in space in each of its four parts), with continuous tractions,
and nowhere above yield. On contact it has neither friction nor tension. It is enough that this
holds at vertices, since yield sets are convex. The interior point method
(:mod:`interior_iteration`) computes it, with the multipliers of equilibrium as velocities. In the
end it is scaled into the yield set, so that its load is a bound, however far the method has come.
"""

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace

import numpy as np

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.limit_analysis.conic.conic_program import UNLIMITED, Start, choose_units
from perfplast_fenicsx.limit_analysis.conic.conic_solver import chosen_conic
from perfplast_fenicsx.limit_analysis.conic.discretisation import SingularStiffness
from perfplast_fenicsx.limit_analysis.conic.interior_steps import (
    InteriorStep,
    Verdict,
    next_start,
)
from perfplast_fenicsx.limit_analysis.discrete.strength_contrast import weak_bodies
from perfplast_fenicsx.limit_analysis.facets.body_interfaces import by_friction_alone
from perfplast_fenicsx.limit_analysis.facets.bound_body import BENT, bound_body
from perfplast_fenicsx.limit_analysis.facets.stress_cells import coefficients_of_radius
from perfplast_fenicsx.limit_analysis.statements.bound import Bound, Scope
from perfplast_fenicsx.limit_analysis.statements.limit_checks import (
    check_bodies_have_limits,
    check_loads,
    check_tolerance,
)
from perfplast_fenicsx.limit_analysis.statements.load_factor import Question
from perfplast_fenicsx.limit_analysis.stress.balanced_stress import BalancedStress
from perfplast_fenicsx.limit_analysis.stress.static_balance import StaticIteration
from perfplast_fenicsx.limit_analysis.stress.static_certificate import certify_stress
from perfplast_fenicsx.limit_analysis.stress.static_form import StaticForm, static_form
from perfplast_fenicsx.limit_analysis.stress.static_program import StaticProgram, static_program
from perfplast_fenicsx.limit_analysis.stress.static_stress import StaticBound, no_stress
from perfplast_fenicsx.mesh.straight_geometry import has_curved_cells
from perfplast_fenicsx.problem.declared.loads import BOUNDED
from perfplast_fenicsx.problem.problem import Problem

CORNERS = (
    "no stress that is linear in the cells can carry the loads: where loaded, free and supported"
    " surfaces meet in a corner, a single cell would have to; divide it, or refine the mesh there"
)

COARSE = (
    "no stress that is linear in the cells can carry the loads and press wherever bodies touch;"
    " refine the mesh"
)

UNREACHED = (
    "no stress in equilibrium was reached, and on a coarse mesh there may be none that presses"
    " wherever bodies touch; refine the mesh"
)
"""Reason for a missing bound after an iteration has stalled. On meshes of twenty cells, linear
programming has shown that there was no such stress.
"""

REPLACED = "the loads of the problem were replaced after its declaration"


def strict_lower_bound(
    problem: Problem,
    rtol: float = 1e-4,
    monitor: Callable[[InteriorStep], None] | None = None,
    question: Question = Question.LIMIT,
    form: StaticForm | None = None,
) -> StaticBound:
    """Bound the limit load of the body from below. Collective.

    Only mesh, materials, supports, loads and contact of the problem matter, not the degree of its
    displacements.

    Args:
        problem: The bodies and their loads.
        rtol: Relative distance of the bound from the best one on this mesh.
        monitor: Called on every rank after each step.
        question: The loads whose factor is sought.
        form: Form of the problem (:func:`form_that_fits`), which its owner keeps; by default it is
            made here, and destroyed in the end.

    Raises:
        InputError: If ``rtol`` is not between 0 and 1, supports move, there are no loads, or bounds
            do not support a body's yield set (:mod:`body_cones`).
    """
    check_bodies_have_limits(problem)
    check_tolerance(rtol)
    check_loads(problem)
    body = bound_body(problem)
    if not problem.as_declared:
        return no_stress(body, Verdict.STALLED, REPLACED)
    if body.prevents is not None:
        return no_stress(body, Verdict.STALLED, body.prevents)
    why_not = body.why_not
    if has_curved_cells(problem.tagged_mesh.mesh):
        why_not = ("cells are curved", *why_not)
    with ExitStack() as made:
        if form is None:
            form = static_form(problem)
            made.callback(form.destroy)
        reached: list[BalancedStress] = []
        given = problem, form, question, why_not, rtol, monitor, reached
        found, start = _search(*given, Start.within(rtol))
        while start is not None:
            before = found
            found, start = _search(*given, start)
            found = _together(before, found)
    return found


def _together(before: StaticBound, after: StaticBound) -> StaticBound:
    """Return the better one of two searches, with the iterations of both."""
    values = [
        (it.bound.strict, -np.inf if it.bound.value is None else it.bound.value)
        for it in (before, after)
    ]
    return replace(
        after if values[1] >= values[0] or after.reason == UNLIMITED else before,
        steps=before.steps + after.steps,
        factorisations=before.factorisations + after.factorisations,
    )


def _search(
    problem: Problem,
    form: StaticForm,
    question: Question,
    why_not: tuple[str, ...],
    rtol: float,
    monitor: Callable[[InteriorStep], None] | None,
    reached: list[BalancedStress],
    start: Start,
) -> tuple[StaticBound, Start | None]:
    """Search from a start; return the result and the next start, None to end. Collective.

    Stresses of earlier searches that are in equilibrium but have left yield are in ``reached``.
    """
    with ExitStack() as made:
        static = static_program(form, question, start.reserve)
        program, body = static.program, form.body
        made.callback(static.destroy)
        if program.degree == program.num_pairs:
            reason = "nothing can yield; give the bodies that may collapse a yield stress"
            return no_stress(body, Verdict.UNBOUNDED, reason), None
        try:
            limited = choose_units(program, start)
        except SingularStiffness as failure:
            found = no_stress(body, Verdict.STALLED, str(failure))
            return found, next_start(start, program, None, found.verdict, rtol)
        if not limited:
            found = no_stress(body, Verdict.UNBOUNDED, UNLIMITED)
            return found, next_start(start, program, None, found.verdict, rtol)
        none = None  # with permanent loads, zero stress is not admissible even at load factor 0
        if not program.has_dead:
            none = Bound(0.0, "lower", Scope.MESH if why_not else Scope.BODY, why_not)
        if not static.can_carry():
            return no_stress(body, Verdict.NO_RESISTANCE, _carried_by_none(problem), none), None
        iteration = StaticIteration(static)
        made.callback(iteration.destroy)
        steps: list[InteriorStep] = []
        solve = chosen_conic()
        verdict, reason = solve(iteration, rtol, steps, monitor, least=question.enough)
        taken = static.factorisations
        if verdict is Verdict.NO_RESISTANCE:
            found = no_stress(body, verdict, COARSE, none)
            return replace(found, steps=steps, factorisations=taken), None
        then = next_start(start, program, iteration.now, verdict, rtol)
        end = verdict, reason, steps
        found, stress = _result(static, iteration, problem, why_not, reached, *end)
        certificate = found.certificate
        ended = verdict is Verdict.FOUND or (verdict is Verdict.STALLED and then is None)
        if program.keeps and ended and certificate is not None:
            if certificate.is_balanced and certificate.is_doubted:
                reached.append(stress)
                then = start.with_more_in_reserve(certificate.overstress)
        return found, then


def _carried_by_none(problem: Problem) -> str:
    """Return the likely reason why no stress carries the loads."""
    if not by_friction_alone(problem):
        return CORNERS
    return (
        "only friction may hold a body, and the lower bound does not count friction: give an"
        " adhesion (tresca = ...), or let surfaces separate as they slip (associated = true);"
        " otherwise"
        f" {CORNERS}"
    )


def check_straight(problem: Problem) -> None:
    """Refuse loads that no stress linear in the cells can balance. Collective.

    Raises:
        InputError: If a traction is not linear on each facet, or a similar fault exists.
    """
    prevents = bound_body(problem).prevents
    if prevents is not None and BENT in prevents:
        raise InputError(f"{prevents}, and {BOUNDED}")


def form_that_fits(problem: Problem) -> StaticForm | None:
    """Return the form of lower bounds, and refuse it if its factors exceed the memory. Collective.

    Call it first, and keep the form for :func:`strict_lower_bound`.

    Returns:
        The form; None if there is no lower bound.

    Raises:
        TooLarge: With the memory that is needed and that is available.
        InputError: If a traction is not linear on each facet, and as :func:`strict_lower_bound`.
    """
    check_straight(problem)
    if bound_body(problem).prevents is not None:
        return None
    form = static_form(problem)
    try:
        form.stiffness.check_memory()
    except InputError:
        form.destroy()
        raise
    return form


def _result(
    static: StaticProgram,
    iteration: StaticIteration,
    problem: Problem,
    why_not: tuple[str, ...],
    reached: list[BalancedStress],
    verdict: Verdict,
    reason: str,
    steps: list[InteriorStep],
) -> tuple[StaticBound, BalancedStress]:
    """Return the bound of an iterate with its stress. Collective."""
    program, form = static.program, static.form
    strains = form.strains
    iteration.settle()
    now = iteration.now
    pressure, deviator = program.whole(now.stress, now.load)
    pressure, deviator = static.shared_out((pressure, deviator))
    ratio = program.overstress((pressure, deviator))
    scale = program.stress_unit / (1.0 if program.keeps else max(1.0, ratio))
    pressure, deviator = scale * pressure, scale * deviator
    shrunk = scale / program.stress_unit
    value, aside = shrunk * now.load * program.load_unit, shrunk * now.aside
    told = BalancedStress(pressure, deviator, value, aside)
    if program.keeps:
        told = told.with_some_of(reached, static)
    pressure, deviator, value, aside = told.pressure, told.deviator, told.load, told.aside
    certificate = certify_stress(static, pressure, deviator, value, aside)
    doubts = (UNREACHED, *weak_bodies(problem)) if certificate.is_doubted else ()
    scope = Scope.MESH if why_not else Scope.BODY
    bound = Bound(value, "lower", scope, why_not, doubts=doubts)
    if doubts and (why_not or not np.isfinite(value)):
        bound = Bound(None, "lower", Scope.MESH, (*why_not, *doubts))
    if doubts:
        reason = "; ".join([reason, *doubts])
    count = strains.num_cells
    plastic, unit = program.plastic[: strains.count], program.stress_unit
    radii = np.where(plastic, strains.radii, 0.0) / unit
    pressure, deviator = pressure[: strains.count], deviator[: strains.count]
    heads = radii - np.where(plastic, strains.slopes, 0.0) * pressure / unit
    stress = strains.whole(pressure, deviator)
    if problem.tagged_mesh.axisymmetric:
        rho = coefficients_of_radius(form.body.vertices)
        stress = rho.reshape(-1, 1) * stress
    _, rates = strains.of(iteration.velocity)
    powers = heads * np.linalg.norm(rates, axis=1)
    if strains.tilts is not None:
        powers -= radii * np.einsum("ni,ni->n", strains.tilts, rates)
    for it in strains.sets:
        works = np.einsum("ni,ni->n", deviator[it.at], rates[it.at]) / unit
        powers[it.at] = np.maximum(works, 0.0)
    powers *= program.weights[: strains.count]
    bounded = StaticBound(
        bound=bound,
        verdict=verdict,
        reason=reason,
        stress=stress.reshape(count, len(strains.rows), stress.shape[1]),
        aside=aside,
        dissipation=powers.reshape(count, -1).sum(axis=1) * program.load_unit,
        certificate=certificate,
        steps=steps,
        factorisations=static.factorisations,
    )
    return bounded, told
