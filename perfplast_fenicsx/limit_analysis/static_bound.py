"""A lower bound of the limit load of the body: a stress that is in equilibrium everywhere.

The stress is linear in each cell, in space in each of four parts of it, with tractions that are
continuous and nowhere above yield; without friction and tension on contact. That it is so at
vertices is enough, since yield sets are convex. It is found by the interior point method
(:mod:`interior_iteration`), with the multipliers of equilibrium as velocities, and scaled into the
yield set in the end, so that its load is a bound whatever the method has reached.
"""

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, replace

import numpy as np

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.limit_analysis.bound import TURNED, Bound, Scope
from perfplast_fenicsx.limit_analysis.discretisation import SingularStiffness
from perfplast_fenicsx.limit_analysis.facet_conditions import (
    BENT,
    FacetConditions,
    facet_conditions,
)
from perfplast_fenicsx.limit_analysis.interior_steps import InteriorStep, Verdict, iterate
from perfplast_fenicsx.limit_analysis.limit_checks import (
    check_bodies_have_limits,
    check_proportional,
    check_tolerance,
)
from perfplast_fenicsx.limit_analysis.natural_units import (
    UNLIMITED,
    Start,
    choose_units,
    next_start,
)
from perfplast_fenicsx.limit_analysis.static_balance import StaticIteration
from perfplast_fenicsx.limit_analysis.static_certificate import StaticCertificate, certify_stress
from perfplast_fenicsx.limit_analysis.static_program import StaticProgram, static_program
from perfplast_fenicsx.limit_analysis.strength_contrast import weak_bodies
from perfplast_fenicsx.limit_analysis.stress_cells import mandel_vectors
from perfplast_fenicsx.mesh.curved_cells import has_curved_cells
from perfplast_fenicsx.problem.loads import BOUNDED
from perfplast_fenicsx.problem.problem import Problem

LEFT = 2e-10
"""Force without balance, relative to the strengths at its row, that rounding may leave. The
certificate, which decides, has been seen to find half as much. Of mean stresses 1e6 times the
strengths more is left; the load factor and the stress, still in equilibrium with it, are reduced to
it."""

CORNERS = (
    "no stress that is linear in the cells can carry the loads: where loaded, free and supported"
    " surfaces meet in a corner, one cell alone would have to; divide it, or refine the mesh there"
)

COARSE = (
    "no stress that is linear in the cells can carry the loads and press wherever bodies touch;"
    " refine the mesh"
)

UNREACHED = (
    "no stress in equilibrium was reached, and on a coarse mesh there may be none that presses"
    " wherever bodies touch; refine the mesh"
)
"""Reason without a bound where an iteration has stalled: on meshes of twenty cells linear
programming found that there was none."""

REPLACED = "loads were put in the place of those that the problem was declared with"


@dataclass(frozen=True, eq=False)
class StaticBound:
    """A lower bound and the stress that proves it.

    Attributes:
        bound: The bound, and what it is one of.
        verdict: Whether the best stress of the mesh was found.
        reason: The same in words.
        stress: σ at the bound, Mandel vectors in the user's units, linear between vertices. In the
            plane of shape (num_owned_cells, 3, 4), vertices in the order of the mesh's geometry
            (that of its topology); in space (num_owned_cells, 4, 4, 6), by part and vertex, where
            part a is the one in which the barycentre replaces vertex a.
        contact_facets: Owned facets on which ``contact_pressure`` is given, one of each pair.
        contact_pressure: Pressure at their vertices, by global number, shape (num_facets, d).
        dissipation: γ‖ε‖ of the multipliers, of each owned cell, with L = 1; the sum over all cells
            is the bound, but for the tolerance. Where it is large, smaller cells would help.
        certificate: What the stress leaves; None where there is none.
        steps: What was done.
        factorisations: Of a stiffness.
    """

    bound: Bound
    verdict: Verdict
    reason: str
    stress: Floats
    contact_facets: Longs
    contact_pressure: Floats
    dissipation: Floats
    certificate: StaticCertificate | None
    steps: list[InteriorStep]
    factorisations: int

    def __repr__(self) -> str:
        return f"StaticBound({self.bound!r}; {len(self.steps)} steps; {self.reason})"


def strict_lower_bound(
    problem: Problem,
    rtol: float = 1e-4,
    monitor: Callable[[InteriorStep], None] | None = None,
) -> StaticBound:
    """Bound the limit load of the body from below. Collective.

    Only mesh, materials, supports, loads and contact of the problem matter, not the degree of its
    displacements.

    Args:
        problem: The bodies and their loads.
        rtol: What is left between the bound and the best one on this mesh, relative.
        monitor: Called on every rank after each step.

    Raises:
        InputError: If ``rtol`` is not between 0 and 1, supports move or loads are constant, or a
            body has another law than those of von Mises and Hooke.
    """
    check_bodies_have_limits(problem)
    check_tolerance(rtol)
    check_proportional(problem)
    conditions = facet_conditions(problem)
    if problem.tagged_mesh.axisymmetric:
        return _nothing(conditions, Verdict.STALLED, TURNED)
    if not problem.as_declared:
        return _nothing(conditions, Verdict.STALLED, REPLACED)
    if conditions.prevents is not None:
        return _nothing(conditions, Verdict.STALLED, conditions.prevents)
    why_not = conditions.why_not
    if has_curved_cells(problem.tagged_mesh.mesh):
        why_not = ("cells are curved", *why_not)
    found, start = _search(problem, conditions, why_not, rtol, monitor, Start())
    while start is not None:
        before = found
        found, start = _search(problem, conditions, why_not, rtol, monitor, start)
        found = _together(before, found)
    return found


def _together(before: StaticBound, after: StaticBound) -> StaticBound:
    """The better one of two searches, with what both have taken."""
    values = [-np.inf if it.bound.value is None else it.bound.value for it in (before, after)]
    return replace(
        after if values[1] >= values[0] or after.reason == UNLIMITED else before,
        steps=before.steps + after.steps,
        factorisations=before.factorisations + after.factorisations,
    )


def _search(
    problem: Problem,
    conditions: FacetConditions,
    why_not: tuple[str, ...],
    rtol: float,
    monitor: Callable[[InteriorStep], None] | None,
    start: Start,
) -> tuple[StaticBound, Start | None]:
    """Search from a start, and tell where to begin anew; None to end. Collective."""
    with ExitStack() as made:
        static = static_program(problem, conditions)
        program = static.program
        made.callback(program.destroy)
        if program.degree == program.num_pairs:
            reason = "nothing can yield; give the bodies that may collapse a yield stress"
            return _nothing(conditions, Verdict.UNBOUNDED, reason), None
        try:
            limited = choose_units(program, start)
        except SingularStiffness as failure:
            found = _nothing(conditions, Verdict.STALLED, str(failure))
            return found, next_start(start, program, None, found.verdict, rtol)
        if not limited:
            found = _nothing(conditions, Verdict.UNBOUNDED, UNLIMITED)
            return found, next_start(start, program, None, found.verdict, rtol)
        none = Bound(0.0, "lower", Scope.MESH if why_not else Scope.BODY, why_not)
        if not static.can_carry():
            return _nothing(conditions, Verdict.NO_RESISTANCE, CORNERS, none), None
        iteration = StaticIteration(static)
        made.callback(iteration.destroy)
        steps: list[InteriorStep] = []
        verdict, reason = iterate(iteration, rtol, steps, monitor)
        taken = program.stiffness.factorisations
        if verdict is Verdict.NO_RESISTANCE:
            found = _nothing(conditions, verdict, COARSE, none)
            return replace(found, steps=steps, factorisations=taken), None
        then = next_start(start, program, iteration.now, verdict, rtol)
        return _result(
            static, iteration, problem, conditions, why_not, verdict, reason, steps
        ), then


def check_stress_fits(problem: Problem) -> None:
    """Refuse a mesh whose lower bound does not fit into memory, before all else. Collective.

    Raises:
        TooLarge: With what is needed and what there is.
        InputError: If a traction is not linear on each facet, and as :func:`strict_lower_bound`.
    """
    conditions = facet_conditions(problem)
    if conditions.prevents is not None:
        if BENT in conditions.prevents:
            raise InputError(f"{conditions.prevents}, and {BOUNDED}")
        return
    static = static_program(problem, conditions)
    try:
        static.stiffness.check_memory()
    finally:
        static.program.destroy()


def _result(
    static: StaticProgram,
    iteration: StaticIteration,
    problem: Problem,
    conditions: FacetConditions,
    why_not: tuple[str, ...],
    verdict: Verdict,
    reason: str,
    steps: list[InteriorStep],
) -> StaticBound:
    """What an iterate proves. Collective."""
    program, strains = static.program, static.strains
    iteration.settle()
    now = iteration.now
    pressure, deviator = program.whole((now.pressure, now.deviator), now.load)
    ratio = program.overstress((pressure, deviator))
    scale = program.stress_unit / max(1.0, ratio)
    pressure, deviator = scale * pressure, scale * deviator
    value = now.load * program.load_unit / max(1.0, ratio)
    share = min(1.0, LEFT / max(static.unbalanced((pressure, deviator), value), LEFT))
    pressure, deviator, value = share * pressure, share * deviator, share * value
    certificate, pushes = certify_stress(static, pressure, deviator, value)
    scope = Scope.MESH if why_not else Scope.BODY
    bound = Bound(value, "lower", scope, why_not)
    if not certificate.holds:
        bound = Bound(None, "lower", Scope.MESH, (UNREACHED, *weak_bodies(problem)))
        reason += f"; {UNREACHED}"
    elif share < 1:
        verdict = Verdict.STALLED
        told = (f"{share:.2g} of it is kept, for what rounding leaves of its balance",)
        reason = "; ".join([reason, *told, *weak_bodies(problem)])
    tdim, count = strains.gdim, strains.num_cells
    stress = np.column_stack([pressure, deviator]) @ mandel_vectors(tdim)
    shape = (count, 3, 4) if tdim == 2 else (count, 4, 4, 6)
    _, rates = strains.of(iteration.velocity)
    powers = np.zeros(strains.count)
    plastic, gammas = program.plastic, program.radii
    powers[plastic] = program.weights[plastic] * gammas * np.linalg.norm(rates[plastic], axis=1)
    return StaticBound(
        bound=bound,
        verdict=verdict,
        reason=reason,
        stress=stress.reshape(shape),
        contact_facets=np.sort(conditions.hosts),
        contact_pressure=pushes.reshape(-1, tdim),
        dissipation=powers.reshape(count, -1).sum(axis=1) * program.load_unit,
        certificate=certificate,
        steps=steps,
        factorisations=program.stiffness.factorisations,
    )


def _nothing(
    conditions: FacetConditions, verdict: Verdict, reason: str, bound: Bound | None = None
) -> StaticBound:
    """The stress 0, and no bound unless one is given."""
    count, _, tdim = conditions.vertices.shape
    shape = (count, 3, 4) if tdim == 2 else (count, 4, 4, 6)
    return StaticBound(
        bound=bound or Bound(None, "lower", Scope.MESH, (reason,)),
        verdict=verdict,
        reason=reason,
        stress=np.zeros(shape),
        contact_facets=np.zeros(0, dtype=np.int64),
        contact_pressure=np.zeros((0, tdim)),
        dissipation=np.zeros(count),
        certificate=None,
        steps=[],
        factorisations=0,
    )
