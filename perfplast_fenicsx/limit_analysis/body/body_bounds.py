"""Bounds of the limit load of the body that a mesh fills, and not just of the mesh."""

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.limit_analysis.body.bare_cells import with_room_for_stress
from perfplast_fenicsx.limit_analysis.body.bound_words import proven_words
from perfplast_fenicsx.limit_analysis.body.parts_of_cells import of_parents, on_parts
from perfplast_fenicsx.limit_analysis.body.ring_results import VelocityOf, of_displacements
from perfplast_fenicsx.limit_analysis.conic.natural_units import UNLIMITED
from perfplast_fenicsx.limit_analysis.discrete.body_cones import body_cones
from perfplast_fenicsx.limit_analysis.discrete.cohesion import check_cohesion
from perfplast_fenicsx.limit_analysis.discrete.discrete_limit import (
    InteriorStep,
    Verdict,
    interior_point,
)
from perfplast_fenicsx.limit_analysis.discrete.limit_methods import LimitLoad, from_interior_point
from perfplast_fenicsx.limit_analysis.discrete.strength_contrast import NOTICED, strong_bodies
from perfplast_fenicsx.limit_analysis.facets.associated_slip import with_associated_slip
from perfplast_fenicsx.limit_analysis.facets.contact_strength import strengths_of
from perfplast_fenicsx.limit_analysis.facets.entering import without_entering
from perfplast_fenicsx.limit_analysis.facets.ring_flux import by_flux, check_known
from perfplast_fenicsx.limit_analysis.facets.vertex_points import with_points_at_vertices
from perfplast_fenicsx.limit_analysis.statements.bound import (
    CONFINED,
    NO_MECHANISM,
    Bound,
    Scope,
    measure_of,
)
from perfplast_fenicsx.limit_analysis.statements.limit_checks import (
    check_bodies_have_limits,
    check_loads,
    check_tolerance,
)
from perfplast_fenicsx.limit_analysis.statements.question import Question
from perfplast_fenicsx.limit_analysis.stress.standing_stress import with_standing_stress
from perfplast_fenicsx.limit_analysis.stress.static_bound import (
    StaticBound,
    check_stress_fits,
    strict_lower_bound,
)
from perfplast_fenicsx.limit_analysis.stress.static_certificate import beside_mechanism
from perfplast_fenicsx.limit_analysis.velocity.gap_shares import gap_shares
from perfplast_fenicsx.limit_analysis.velocity.strict_work import strict_upper_bound
from perfplast_fenicsx.mesh.alfeld_split import alfeld_split
from perfplast_fenicsx.mesh.curved_cells import has_curved_cells
from perfplast_fenicsx.problem.declared.loads import check_bounded
from perfplast_fenicsx.problem.judged.certificate import contact_forces
from perfplast_fenicsx.problem.problem import Problem

log = logging.getLogger(__name__)

NOT_SOUGHT = Bound(None, "lower", Scope.MESH, ("not computed; control = 'bounds' computes it",))

STANDING = "no load factor was sought, but how many times constant loads are carried"

DRUCKER = (
    "With Coulomb's friction they are Drucker's pair: frictionless from below, but for adhesion,"
    " and associated from above, whichever way it slips"
)


@dataclass(frozen=True)
class BodyBounds:
    """What is known of the limit load of a body.

    Attributes:
        problem: On whose mesh the mechanism is; in space each cell is split from its centre.
        lower: A lower bound.
        upper: An upper bound.
        mechanism: Velocity v of the upper bound, with L(v) = 1; zero where none was found.
        by_flux: Around an axis v = ru (:mod:`ring_flux`), of which the upper bound is.
        mesh: The limit load of this mesh, which bounds that of the body on neither side.
        static: The lower bound with its stress; None where none was sought.
        stress: That stress, Mandel vectors at the vertices of this rank's cells of ``problem``,
            shape (num_cells, d + 1, m); None without a lower bound, and in space where cells are
            not split (curved ones, linear elements).
        shares: What each owned cell of the mesh, before it was split in space, has of the gap
            (:mod:`gap_shares`), shape (num_cells,); None without both bounds.
        certificates: What is left of what a bound asks for, by name.
        steps: Of the interior point method, for both bounds.
        factorisations: For both bounds.
        advice: What to change for better bounds, in clauses.
        question: Of which loads the factor is bounded: of the growing ones, or, where the constant
            ones were found to be too much on the mesh, of these (:class:`question.Question`).
    """

    problem: Problem
    lower: Bound
    upper: Bound
    mechanism: fem.Function
    mesh: LimitLoad
    static: StaticBound | None = None
    stress: Floats | None = None
    shares: Floats | None = None
    certificates: Mapping[str, float] = field(default_factory=dict)
    steps: int = 0
    factorisations: int = 0
    advice: tuple[str, ...] = ()
    question: Question = Question.LIMIT
    by_flux: VelocityOf | None = None

    @property
    def flow(self) -> VelocityOf:
        """The velocity of which the upper bound is."""
        return self.by_flux or VelocityOf(self.problem, self.mechanism)

    @property
    def limits(self) -> tuple[Bound, Bound]:
        """Bounds of the load factor ζ; without values where they are of the constant loads."""
        if self.question is Question.LIMIT:
            return self.lower, self.upper
        why = (STANDING,)
        return Bound(None, "lower", Scope.MESH, why), Bound(None, "upper", Scope.MESH, why)

    @property
    def strict(self) -> bool:
        """Whether both hold for the body, but for rounding."""
        return self.lower.strict and self.upper.strict

    @property
    def why_not(self) -> list[str]:
        """Why one of them does not; nothing where both do."""
        bounds = (self.lower, self.upper)
        return [f"{bound.kind} bound: {why}" for bound in bounds for why in bound.why_not]

    def __repr__(self) -> str:
        return f"BodyBounds({self.lower!r}, {self.upper!r}; {self.factorisations} factorisations)"

    def in_words(self) -> str:
        """What they say, in a sentence or two."""
        lower, upper = self.lower.strict, self.upper.strict
        early = []
        if not self.mesh.levelled_off and upper:
            early.append(f" The upper one is not the best of its mesh: {self.mesh.reason}.")
        if self.static is not None and self.static.verdict is not Verdict.FOUND and lower:
            early.append(f" The lower one is not the best of its mesh: {self.static.reason}.")
        early += [f" {words[0].upper()}{words[1:]}." for words in self.advice]
        if self.friction is not None and (lower or upper):
            early.append(f" {self.friction}.")
        proven = proven_words(self.lower, self.upper, self.question, self.why_not)
        return proven + "".join(early)

    @property
    def friction(self) -> str | None:
        """What the bounds say of Coulomb's friction, in a sentence; None without it."""
        return DRUCKER if any(it.friction for it in strengths_of(self.problem)) else None


def limit_bounds(
    problem: Problem, rtol: float = 1e-4, monitor: Callable[[InteriorStep], None] | None = None
) -> BodyBounds:
    """Find bounds of the limit load of the body that the mesh fills. Collective.

    Cells in corners of plane bodies that could carry nothing are divided (:mod:`lone_corners`). The
    mechanism is the best of the mesh that keeps the volume everywhere, for which tetrahedra are
    split from their centres, or grows by enough where bodies dilate, for which laws are asked at
    vertices; and it enters no other body between the nodes either.

    Args:
        problem: The bodies and their loads; quadratic elements are wanted, as linear ones lock.
        rtol: How near each bound comes to the best of its kind on this mesh, relative.
        monitor: Called on every rank after each step.

    Raises:
        InputError: If ``rtol`` is not between 0 and 1, supports move or no load grows, a body
            has a yield set that bounds do not know, strict bounds do not know a load,
            no stress can carry them, bodies of revolution dilate or are apart (:mod:`ring_flux`),
            or a bound does not fit into memory (the lower one is asked first, before anything is
            computed).
    """
    if problem.tagged_mesh.axisymmetric and problem.given.rigid:
        raise InputError(
            f"the surface '{problem.given.rigid[0].on}' is rigid, beside which bodies of revolution"
            " have no strict bounds; give control = 'work' and until = 'limit', for the limit load"
            " of the mesh."
        )
    for load in problem.given.loads:
        check_bounded(load)
    check_bodies_have_limits(problem)
    check_tolerance(rtol)
    check_loads(problem)
    if problem.tagged_mesh.axisymmetric:
        check_known(problem, body_cones(problem).dilates)
    check_cohesion(problem)
    problem = with_room_for_stress(problem)
    check_stress_fits(problem)
    given, split = problem, None
    tagged_mesh = problem.tagged_mesh
    straight = problem.degree == 2 and not has_curved_cells(tagged_mesh.mesh)
    if problem.bodies.gdim == 3 and straight:
        split = alfeld_split(tagged_mesh)
        problem = problem.on(split)
    by_ring = tagged_mesh.axisymmetric and straight
    if by_ring:
        problem = by_flux(problem)
    if straight and body_cones(problem).dilates:
        problem = with_points_at_vertices(problem)
    log.info("upper bound: a mechanism on %s", problem)
    searched = with_associated_slip(without_entering(problem) or problem)
    found = interior_point(searched, rtol, monitor)
    limit = from_interior_point(found)
    if np.isfinite(limit.lower):  # of pairs, not of coefficients
        limit = replace(limit, contact_forces=contact_forces(problem, found.stress, limit.lower))
    bounds = bounds_of_mesh(problem, limit)
    log.info("lower bound: a stress on the same cells")
    static = strict_lower_bound(given, rtol, monitor, bounds.question)
    static = with_standing_stress(given, static, rtol, monitor, bounds.question)
    lower, certificates = static.bound, {}
    if static.certificate is not None:
        certificates = vars(static.certificate)
        if bounds.upper.value is not None:
            _, dead, _ = bounds.question.of(
                0.0, problem.loads.dead_work(bounds.mechanism.x.petsc_vec)
            )
            value, loose = bounds.upper.value, body_cones(problem).loose
            power = measure_of(value + dead, value, loose)
            lower = beside_mechanism(lower, static.certificate, power, bounds.mechanism)
    stress = shares = None
    # parts of a tetrahedron that is not split for the mechanism are no cells of any mesh
    if static.bound.value is not None and (split is not None or problem.bodies.gdim == 2):
        stress = static.stress if split is None else on_parts(static.stress, split)
        if bounds.upper.value is not None:
            shares = gap_shares(problem, bounds.mechanism, stress)
            shares = shares if split is None else of_parents(shares, split)
    if by_ring:
        velocity, mesh = of_displacements(given, bounds.flow, bounds.mesh)
        flow = bounds.flow
        bounds = replace(bounds, problem=given, mechanism=velocity, mesh=mesh, by_flux=flow)
    return replace(
        bounds,
        lower=lower,
        static=static,
        stress=stress,
        shares=shares,
        certificates={**bounds.certificates, **certificates},
        steps=bounds.steps + len(static.steps),
        factorisations=bounds.factorisations + static.factorisations,
    )


def bounds_of_mesh(problem: Problem, limit: LimitLoad) -> BodyBounds:
    """What the limit load of a mesh tells of the body: the work of its mechanism. Collective.

    Args:
        problem: The bodies and their loads.
        limit: As found by the interior point method.
    """
    certificates = {} if limit.inadmissible is None else {"inadmissible": limit.inadmissible}
    advice: tuple[str, ...] = ()
    question = limit.question
    stands = question is Question.STANDS
    if limit.upper is None and not (stands and limit.collapses):
        dilates = any(on.law.dilates for on in problem.laws)
        why = CONFINED if dilates else NO_MECHANISM
        why = UNLIMITED if limit.reason == UNLIMITED else why
        upper = Bound(None, "upper", Scope.MESH, (why,))
    else:
        upper = strict_upper_bound(problem, limit.mechanism, question=question)
    if upper.of_rounding > NOTICED:
        advice = strong_bodies(problem, upper.of_rounding)
    return BodyBounds(
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
