"""Compute a lower bound on the body's limit load from a stress in equilibrium everywhere.

The stress is linear in each cell (in 3D in each of its four parts), has continuous tractions, and
lies in the yield set. Contact surfaces transmit no tension, and no shear except by adhesion or by
friction with associated slip. Because yield sets are convex, these conditions need to hold only at
the vertices. The interior point method (:mod:`interior_iteration`) computes the stress, with the
multipliers of equilibrium as velocities. At the end, the module scales the stress into the yield
set. The load of the scaled stress is therefore a bound even if the method has not converged.

:class:`BalancedStress` combines stresses in equilibrium by weighted means. With constant loads, a
stress outside the yield set cannot be scaled down. However, the mean of two stresses in equilibrium
is in equilibrium at the mean of their load factors, and yield sets are convex. The mean of a stress
slightly outside the yield set and a stress well inside can therefore be inside. Computing this mean
is faster than a new search.
"""

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace

from mpi4py import MPI

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.limit_analysis.conic.conic_program import UNLIMITED, Start
from perfplast_fenicsx.limit_analysis.conic.conic_solver import chosen_conic
from perfplast_fenicsx.limit_analysis.conic.discretisation import SingularStiffness
from perfplast_fenicsx.limit_analysis.conic.interior_iteration import InteriorIteration, rebalance
from perfplast_fenicsx.limit_analysis.conic.interior_steps import (
    InteriorStep,
    Verdict,
    choose_units,
    next_start,
)
from perfplast_fenicsx.limit_analysis.discrete.body_cones import body_cones
from perfplast_fenicsx.limit_analysis.discrete.strength_fields import weak_bodies
from perfplast_fenicsx.limit_analysis.facets.body_interfaces import by_friction_alone
from perfplast_fenicsx.limit_analysis.facets.bound_body import BENT, BoundBody, bound_body
from perfplast_fenicsx.limit_analysis.facets.stress_cells import coefficients_of_radius
from perfplast_fenicsx.limit_analysis.statements.limit_checks import (
    check_bodies_have_limits,
    check_loads,
    check_tolerance,
)
from perfplast_fenicsx.limit_analysis.statements.load_factor import Bound, Question, Scope
from perfplast_fenicsx.limit_analysis.stress.static_form import StaticForm, static_form
from perfplast_fenicsx.limit_analysis.stress.static_program import (
    StaticCertificate,
    StaticProgram,
    certify_stress,
    static_program,
)
from perfplast_fenicsx.mesh.straight_geometry import has_curved_cells
from perfplast_fenicsx.problem.declared.loads import BOUNDED
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.rounding import rounded_down


@dataclass(frozen=True, eq=False)
class BalancedStress:
    """A stress at the points of a static program, in the user's units.

    Attributes:
        pressure: Mean stress in the coordinates of the cones, shape (count,).
        deviator: Deviator in these coordinates, shape (count, m).
        load: Load factor λ.
        aside: Factor of the free loads.
    """

    pressure: Floats
    deviator: Floats
    load: float
    aside: float

    def over(self, static: StaticProgram) -> float:
        """Return the relative excess of the stress over the yield set, negative inside the set.

        Collective.
        """
        scale = 1 / static.program.stress_unit
        return static.program.overstress((scale * self.pressure, scale * self.deviator)) - 1

    def with_some_of(
        self, others: "Sequence[BalancedStress]", static: StaticProgram
    ) -> "BalancedStress":
        """Return the best mean, inside the yield set, of this stress and one of ``others``.

        Collective.

        Args:
            others: Stresses outside the yield set, while this stress is inside.
            static: The conditions.

        Returns:
            The mean with the largest load; this stress if no mean has a larger load.
        """
        best, room = self, -self.over(static)
        for other in others if room > 0 else ():
            beyond = other.over(static)
            rounding = 1e-3  # additional share of this stress, for rounding
            share = min(1.0, (1 + rounding) * beyond / (beyond + room))
            mean = self.mean(other, share)
            if mean.load > best.load and mean.over(static) <= 0:
                best = mean
        return best

    def mean(self, other: "BalancedStress", share: float) -> "BalancedStress":
        """Return ``share`` times this stress plus the remaining share times another stress."""
        both = zip(vars(self).values(), vars(other).values(), strict=True)
        return BalancedStress(*(share * one + (1 - share) * more for one, more in both))


class StaticIteration(InteriorIteration):
    """The iteration of a lower bound, which at the end measures equilibrium row by row.

    During the iteration, unbalanced forces are relative to the loads. At the end, these forces must
    be small relative to the strengths. The two measures differ if hydrostatic pressures are large,
    and where a weak body touches a strong body.
    """

    def __init__(self, static: StaticProgram) -> None:
        """Start as :class:`InteriorIteration`. Collective."""
        super().__init__(static.program)
        self._static = static
        self._rows: Floats | None = None

    def unbalanced(self) -> float:
        """Return the largest unbalanced force, relative to the loads. Collective.

        After :meth:`settle`, the force is relative to the strength in its row.
        """
        if self._rows is None:
            return super().unbalanced()
        mine = float((np.abs(self.balance().array_r) / self._rows).max(initial=0.0))
        return float(self.program.comm.allreduce(mine, MPI.MAX)) * self.program.force_unit

    def row_units(self) -> Floats | float:
        """Return the units of the rows of equilibrium; see :meth:`InteriorIteration.row_units`."""
        return super().row_units() if self._rows is None else self._rows

    def settle(self) -> None:
        """Balance stress and loads in each row of equilibrium, as far as rounding permits.

        Collective.
        """
        pressure, _ = self.program.whole(self.now.stress, self.now.load)
        self._rows = self._static.forces_of_strengths(self.program.stress_unit * pressure)
        left = self.unbalanced()
        # Largest unbalanced force, relative to the strength, that needs no correction. The sum of
        # forces of this size over some thousand rows is small even compared with a gap of 1e-7.
        rounding = 1e-14
        most_corrections = 4  # with the same factors, if each correction halves the residual
        for _ in range(most_corrections):
            if left <= rounding:
                return
            before = left
            self.equilibrate()
            left = self.unbalanced()
            if not left < before / 2:
                break
        # Unbalanced forces, relative to strengths, above which a new factorisation corrects them.
        almost_balanced = 1e-13
        if not left <= almost_balanced:
            rebalance(self)


@dataclass(frozen=True, eq=False)
class StaticBound:
    """A lower bound, and the stress that proves the bound.

    Attributes:
        bound: The bound with its scope.
        verdict: Whether the search found the best stress of the mesh.
        reason: Reason for the verdict, in words.
        stress: Stress σ at the bound, as Mandel vectors in the user's units, linear between
            vertices, shape (num_owned_cells, num_points, m). In 2D, the points are the vertices of
            the cell in the order of the mesh's geometry, which is also the order of its topology.
            In 3D, the points are the vertices of the four parts, one part after the other; in part
            a, the barycentre replaces vertex a. In axisymmetry, the values are Bernstein
            coefficients of rσ, which is quadratic (:mod:`stress_cells`).
        dissipation: Dissipation (γ − αp)‖dev ε‖ of the multipliers in each owned cell, normalised
            to L = 1. If bodies preserve their volume, the sum over all cells equals the bound up to
            the tolerance. Refinement is most effective in cells with a large dissipation.
        aside: Factor of the free loads, if there are free loads.
        certificate: Residuals of the stress; None without a stress.
        steps: Steps of the iteration.
        factorisations: Number of factorisations of stiffness matrices.
    """

    bound: Bound
    verdict: Verdict
    reason: str
    stress: Floats
    dissipation: Floats
    aside: float = 0.0
    certificate: StaticCertificate | None = None
    steps: list[InteriorStep] = field(default_factory=list)
    factorisations: int = 0

    def __repr__(self) -> str:
        return f"StaticBound({self.bound!r}; {len(self.steps)} steps; {self.reason})"


def no_stress(
    body: BoundBody, verdict: Verdict, reason: str, bound: Bound | None = None
) -> StaticBound:
    """Return a result with zero stress, and with the given bound or no bound."""
    count, _, tdim = body.vertices.shape
    shape = (count, 6 if body.turned else 3, 4) if tdim == 2 else (count, 16, 6)
    return StaticBound(
        bound=bound or Bound(None, "lower", Scope.MESH, (reason,)),
        verdict=verdict,
        reason=reason,
        stress=np.zeros(shape),
        dissipation=np.zeros(count),
    )


CORNERS = (
    "no stress that is linear in the cells can carry the loads: a single cell cannot balance them"
    " in a corner of loaded, free and supported surfaces; divide the cell, or refine the mesh"
)

UNREACHED = "no stress in equilibrium was found; on a coarse mesh, no stress may carry"
"""Start of the reason for a missing bound after an iteration has stalled. For meshes of twenty
cells, linear programming has shown that no such stress exists.
"""

REPLACED = "the loads of the problem were replaced after its declaration"


def strict_lower_bound(
    problem: Problem,
    rtol: float = 1e-4,
    monitor: Callable[[InteriorStep], None] | None = None,
    question: Question = Question.LIMIT,
    form: StaticForm | None = None,
    reserve: float | None = None,
) -> StaticBound:
    """Return a lower bound on the body's limit load. Collective.

    The bound depends on the mesh, materials, supports, loads and contact of the problem, and not on
    the degree of its displacements.

    Args:
        problem: The bodies and their loads.
        rtol: Largest relative difference between the bound and the best bound on this mesh.
        monitor: Called on every rank after each step.
        question: The loads whose factor is bounded.
        form: Form of the problem (:func:`form_that_fits`), which the caller owns; by default the
            function creates and destroys a form.
        reserve: Share of the strengths that is kept in reserve for rounding if there are constant
            loads; by default :attr:`Start.reserve`.

    Raises:
        InputError: If ``rtol`` is not between 0 and 1, if supports move, if there are no loads, if
            no limit theorem holds for a body, or if bounds do not support a body's yield set
            (:mod:`body_cones`).
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
        first = Start.within(rtol) if reserve is None else Start(reserve=reserve)
        found, start = _search(*given, first)
        while start is not None:
            other, start = _search(*given, start)
            found = _together(found, other)
    return found


def _together(before: StaticBound, after: StaticBound) -> StaticBound:
    """Return the better result of two searches, with the steps of both."""
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
    """Search from a start; return the result, and the next start or None. Collective.

    The list ``reached`` contains stresses of earlier searches that are in equilibrium but outside
    the yield sets.
    """
    with ExitStack() as made:
        static = static_program(form, question, start.reserve)
        program, body = static.program, form.body
        made.callback(static.destroy)
        if program.degree == program.num_pairs:
            reason = "nothing can yield; give the bodies that may collapse a yield stress"
            return no_stress(body, Verdict.UNBOUNDED, reason), None
        verdict, reason = Verdict.UNBOUNDED, UNLIMITED
        try:
            limited = choose_units(program, start)
        except SingularStiffness as failure:
            limited, verdict, reason = False, Verdict.STALLED, str(failure)
        if not limited:
            found = no_stress(body, verdict, reason)
            return found, next_start(start, program, None, verdict, rtol)
        none = None  # with constant loads, zero stress is not admissible even at load factor 0
        if not program.has_dead:
            none = Bound(0.0, "lower", Scope.MESH if why_not else Scope.BODY, why_not)
        if not static.can_carry():
            return no_stress(body, Verdict.NO_RESISTANCE, _carried_by_none(problem), none), None
        iteration = StaticIteration(static)
        made.callback(iteration.destroy)
        steps: list[InteriorStep] = []
        verdict, reason = chosen_conic()(iteration, rtol, steps, monitor, least=question.enough)
        if verdict is Verdict.NO_RESISTANCE:
            reason = _no_stress_on_mesh(problem, "no stress that is linear in the cells can carry")
            found = no_stress(body, verdict, reason, none)
            return replace(found, steps=steps, factorisations=static.factorisations), None
        then = next_start(start, program, iteration.now, verdict, rtol)
        found, stress = _result(
            static, iteration, problem, why_not, reached, verdict, reason, steps
        )
        certificate = found.certificate
        ended = verdict is Verdict.FOUND or (verdict is Verdict.STALLED and then is None)
        if program.keeps and ended and certificate is not None:
            if certificate.is_balanced and certificate.is_doubted:
                reached.append(stress)
                then = start.with_more_in_reserve(certificate.overstress)
        return found, then


def _no_stress_on_mesh(problem: Problem, what: str) -> str:
    """Return the reason for a missing bound on a coarse mesh, and its remedy.

    Args:
        problem: The bodies and their loads.
        what: The first words, to which the function adds the loads.
    """
    touch = problem.given.contacts or problem.given.obstacles
    pressed = " with compression on all contact surfaces" if touch else ""
    sand = ", or give ground without cohesion a small one" if body_cones(problem).loose else ""
    return f"{what} the loads{pressed}; refine the mesh{sand}"


def _carried_by_none(problem: Problem) -> str:
    """Return the likely reason why there is no stress in balance with the loads."""
    if not by_friction_alone(problem):
        return CORNERS
    return (
        "only friction may hold a body, and the lower bound does not count friction: give an"
        " adhesion (tresca = ...), or let surfaces separate as they slip (associated = true);"
        " otherwise"
        f" {CORNERS}"
    )


def check_straight(problem: Problem) -> None:
    """Refuse tractions that piecewise linear stresses cannot balance.

    Raises:
        InputError: If a traction is not linear on each facet, or if a pore pressure is not linear
            in each cell.
    """
    prevents = bound_body(problem).prevents
    if prevents is not None and BENT in prevents:
        raise InputError(f"{prevents}, but {BOUNDED}")


def form_that_fits(problem: Problem) -> StaticForm | None:
    """Return the form of lower bounds if the factors of its stiffness fit into memory. Collective.

    Call this function first, and pass the form to :func:`strict_lower_bound`.

    Returns:
        The form; None if no lower bound is possible.

    Raises:
        TooLarge: If the factors do not fit; the message gives the needed and the available memory.
        InputError: If a traction is not linear on each facet, or if :func:`strict_lower_bound`
            refuses the problem.
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
    """Return the bound from the last iterate, and its stress. Collective."""
    program, form = static.program, static.form
    strains = form.strains
    iteration.settle()
    now = iteration.now
    pressure, deviator = static.shared_out(program.whole(now.stress, now.load))
    shrunk = 1.0
    if not program.keeps:
        shrunk = 1 / max(1.0, program.overstress((pressure, deviator)))
    unit = program.stress_unit
    told = BalancedStress(
        shrunk * unit * pressure,
        shrunk * unit * deviator,
        shrunk * now.load * program.load_unit,
        shrunk * now.aside,
    )
    if program.keeps:
        told = told.with_some_of(reached, static)
    certificate = certify_stress(static, told.pressure, told.deviator, told.load, told.aside)
    doubts: tuple[str, ...] = ()
    if certificate.is_doubted:
        doubts = _no_stress_on_mesh(problem, UNREACHED), *weak_bodies(problem)
    scope = Scope.MESH if why_not else Scope.BODY
    bound = Bound(told.load, "lower", scope, why_not, doubts=doubts)
    if doubts and (why_not or not np.isfinite(told.load)):
        bound = Bound(None, "lower", Scope.MESH, (*why_not, *doubts))
    count, plastic = strains.num_cells, program.plastic[: strains.count]
    radii = np.where(plastic, strains.radii, 0.0) / unit
    pressure, deviator = told.pressure[: strains.count], told.deviator[: strains.count]
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
        reason="; ".join([reason, *doubts]),
        stress=stress.reshape(count, len(strains.rows), stress.shape[1]),
        aside=told.aside,
        dissipation=powers.reshape(count, -1).sum(axis=1) * program.load_unit,
        certificate=certificate,
        steps=steps,
        factorisations=static.factorisations,
    )
    return bounded, told


def bound_by_stress(
    problem: Problem,
    rtol: float,
    monitor: Callable[[InteriorStep], None] | None,
    question: Question,
    form: StaticForm | None,
    reserve: float | None = None,
) -> StaticBound:
    """Return a lower bound, or a result that shows which cells to refine. Collective.

    With constant loads, the mesh may allow no stress in equilibrium and in the yield sets at any
    load factor, although the body has such a stress. The function then computes the multiple of the
    constant loads that the mesh carries; the dissipation of this result shows which cells must be
    smaller. The arguments are those of :func:`strict_lower_bound`.
    """
    static = strict_lower_bound(problem, rtol, monitor, question, form, reserve)
    doubted = static.bound.value is None or static.bound.doubts
    if not doubted or question is Question.STANDS:
        return static
    if not problem.loads.has_dead() or static.verdict is not Verdict.STALLED:
        return static
    stands = strict_lower_bound(problem, rtol, monitor, Question.STANDS, form)
    times = stands.bound.value
    if times is None or stands.bound.doubts or times >= 1:
        return static
    why = (
        f"stresses that are linear in the cells carry at most {rounded_down(times)} times the"
        " constant loads, at any load factor; refine the mesh"
    )
    return replace(
        static,
        bound=replace(static.bound, value=None, of=Scope.MESH, why_not=(why,), doubts=()),
        reason=why,
        dissipation=stands.dissipation,
        steps=static.steps + stands.steps,
        factorisations=static.factorisations + stands.factorisations,
    )
