"""How many times a load domain may be gone through again and again: Melan's load, and what ends it.

What is found is that of the mesh. Elastic stresses are those of its finite elements, and balance is
theirs, so that this is an estimate of the bodies' load, and no bound of it. Stresses are within
yield in all of each straight cell (:mod:`linear_stresses`). Where elastic stresses are infinite, as
in a re-entrant corner, it falls to nothing as the mesh gets finer.
"""

import time
from collections.abc import Callable
from contextlib import ExitStack

import numpy as np
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.limit_analysis.conic.discretisation import SingularStiffness
from perfplast_fenicsx.limit_analysis.conic.interior_steps import MOST_STEPS, InteriorStep
from perfplast_fenicsx.limit_analysis.shakedown.corner_cones import CornerCones
from perfplast_fenicsx.limit_analysis.shakedown.elastic_stresses import (
    check_names,
    elastic_stresses,
)
from perfplast_fenicsx.limit_analysis.shakedown.linear_stresses import StressPoints, stress_points
from perfplast_fenicsx.limit_analysis.shakedown.load_domain import LoadDomain
from perfplast_fenicsx.limit_analysis.shakedown.melan_iteration import MelanIteration
from perfplast_fenicsx.limit_analysis.shakedown.point_laws import PointLaws
from perfplast_fenicsx.limit_analysis.shakedown.point_operator import PointOperator
from perfplast_fenicsx.limit_analysis.shakedown.shakedown_result import Failure, ShakedownLoad
from perfplast_fenicsx.limit_analysis.statements.limit_checks import (
    check_bodies_have_limits,
    check_tolerance,
)
from perfplast_fenicsx.problem.declared.initial import Temperature
from perfplast_fenicsx.problem.declared.stage import called
from perfplast_fenicsx.problem.problem import Problem


def shakedown_load(
    problem: Problem,
    domain: LoadDomain,
    rtol: float = 1e-4,
    monitor: Callable[[InteriorStep], None] | None = None,
) -> ShakedownLoad:
    """Return the largest λ for which bodies shake down to λ times a load domain. Collective.

    Args:
        problem: The bodies; constant loads act all the time.
        domain: Factors of the other loads, and of temperatures.
        rtol: Relative difference of the static and the kinematic value.
        monitor: Called on every rank after each step.

    Raises:
        InputError: If bodies touch, a name is unknown, supports move, or a law has no suitable
            cone.
    """
    _check(problem, domain, rtol)
    with ExitStack() as made:
        points = stress_points(problem)
        operator = PointOperator(points.working)
        made.callback(operator.destroy)
        laws = PointLaws.of(points.known)
        live, dead = elastic_stresses(problem, domain.names, points, operator, laws)
        corners = np.einsum("cn,npi->cpi", np.unique(domain.corners, axis=0), live)
        cones = CornerCones.of(problem.comm, laws, operator.weights, corners, dead)
        if cones is None:
            raise InputError(
                "what varies stresses no body that can yield, so that nothing limits it; give the"
                " bodies that may yield a yield stress, or a load that is not zero."
            )
        iteration = MelanIteration(cones, operator)
        made.callback(iteration.destroy)
        steps, converged, reason = _iterate(iteration, rtol, monitor)
        return _found(points, domain, operator, iteration, (steps, converged, reason))


def check_shakedown(problem: Problem, domain: LoadDomain, rtol: float = 1e-4) -> None:
    """Refuse what :func:`shakedown_load` would refuse before it solves. Collective.

    Args:
        problem: The bodies.
        domain: Factors of what varies.
        rtol: Difference of both values, relative.

    Raises:
        InputError: As :func:`shakedown_load`, but for loads that stress no body which may yield.
    """
    _check(problem, domain, rtol)
    PointLaws.of(stress_points(problem).known)


def _check(problem: Problem, domain: LoadDomain, rtol: float) -> None:
    check_tolerance(rtol)
    check_bodies_have_limits(problem)
    _check_bonds(problem)
    warmed = [called(a) for a in problem.given.initial if isinstance(a, Temperature)]
    check_names(problem.given.loads, warmed, domain.names)


def _check_bonds(problem: Problem) -> None:
    """Refuse given motions, and problems in which elastic stresses do not superpose."""
    if problem.num_pairs or problem.friction.count:
        raise InputError(
            "shakedown is for bodies that do not part and do not slide, since elastic stresses of"
            " single loads are added up; make contacts that stay closed [[tie]] tables."
        )
    if problem.motion.moves_supports or problem.motion.driven:
        raise InputError("shakedown is for loads and temperatures; let supports rest.")


def _iterate(
    iteration: MelanIteration, rtol: float, monitor: Callable[[InteriorStep], None] | None
) -> tuple[int, bool, str]:
    """Step until both values meet. Collective."""
    settled = 1e-6  # forces and flow that may be left over, relative
    began, unit = time.perf_counter(), iteration.cones.load_unit
    for number in range(1, MOST_STEPS + 1):
        try:
            length = iteration.step()
        except SingularStiffness as failure:
            return number, False, str(failure)
        gap = iteration.gap() / max(abs(iteration.load), 1.0)
        unbalanced, off = iteration.unbalanced(), iteration.incompatible()
        missing = iteration.missing_work()
        if monitor is not None:
            seconds = time.perf_counter() - began
            told = (iteration.load * unit, gap, unbalanced, off, length, seconds)
            monitor(InteriorStep(number, *told))
        if max(unbalanced, off, missing) <= settled and gap <= rtol:
            if iteration.load <= rtol:
                return number, False, "the constant loads alone are not carried"
            return number, True, f"the steps have converged to {rtol:g}"
        if length < 1e-7:
            return number, False, "the steps became too short"
    return MOST_STEPS, False, f"both values have not met in {MOST_STEPS} steps"


def _found(
    points: StressPoints,
    domain: LoadDomain,
    operator: PointOperator,
    iteration: MelanIteration,
    ended: tuple[int, bool, str],
) -> ShakedownLoad:
    """Return the shakedown load of an iteration, in the user's units. Collective."""
    cones, problem = iteration.cones, points.known
    mechanism = fem.Function(problem.V, name="mechanism")
    operator.displace(iteration.velocity, mechanism)
    dissipation, residual = fem.Function(problem.Q), fem.Function(problem.S)
    power = cones.at_points(cones.dissipation(iteration.multipliers)[:, None])[:, 0]
    _set(dissipation, power / cones.weights)
    _set(residual, iteration.residual * cones.stress_unit)
    share = cones.accumulated(iteration.multipliers)
    steps, converged, reason = ended
    over, first = cones.ratio(iteration.load, iteration.residual), cones.first_yield()
    return ShakedownLoad(
        domain=domain,
        problem=problem,
        linear=points.linear,
        load=iteration.load * cones.load_unit,
        upper=cones.total(float(cones.dissipation(iteration.multipliers).sum())) * cones.load_unit,
        over=over,
        unbalanced=iteration.unbalanced(),
        first_yield=None if first is None else first * cones.load_unit,
        accumulated=share,
        failure=Failure.of(share) if converged else Failure.NONE,
        mechanism=mechanism,
        dissipation=dissipation,
        residual=residual,
        steps=steps,
        factorisations=operator.factorisations + 1,  # that of elastic stresses
        linear_solves=operator.solves + len(domain.names) + 1,
        converged=converged,
        reason=reason,
    )


def _set(function: fem.Function, values: Floats) -> None:
    """Give a function of the points its values. Collective."""
    function.x.array[: values.size] = values.ravel()
    function.x.scatter_forward()
