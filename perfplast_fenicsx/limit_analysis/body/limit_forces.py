"""Forces of loads, supports, obstacles and contacts where bodies are carried, or collapse."""

import math
from dataclasses import dataclass, replace

from dolfinx import fem

from perfplast_fenicsx.limit_analysis.body.body_bounds import BodyBounds
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitLoad
from perfplast_fenicsx.limit_analysis.statements.question import Question
from perfplast_fenicsx.problem.assembled.integrals import assemble_force
from perfplast_fenicsx.problem.judged.certificate import contact_forces, friction_forces
from perfplast_fenicsx.problem.judged.resultants import resultants
from perfplast_fenicsx.problem.problem import Problem


@dataclass(frozen=True)
class LimitForces:
    """Forces in balance with a stress.

    Attributes:
        zeta: Load factor that the stress carries.
        strict: Whether that is the strict lower bound of the body; else it is the static side of
            the limit load of the mesh, an estimate, or the last level of a path to it.
        reactions: As of a level (:class:`resultants.Resultants`). Where supports or contacts can
            share a force in several ways, these are one of them.
        moments: Moments of the loads and of supports about the origin.
        balance: As of a level.
    """

    zeta: float
    strict: bool
    reactions: dict[str, list[float]]
    moments: dict[str, list[float]]
    balance: float


def limit_forces(
    problem: Problem, limit: LimitLoad, body: BodyBounds | None = None
) -> LimitForces | None:
    """The forces of the stress that proves a lower bound, else of the limit load. Collective.

    Args:
        problem: On whose mesh the limit load was found.
        limit: With its stress.
        body: With the lower bound, which may be on another mesh.

    Returns:
        None where there is no stress, or it carries nothing.
    """
    if body is not None and (found := _of_bound(body)) is not None:
        return found
    stress, zeta = limit.stress, limit.lower
    if stress is None and limit.theorem and limit.levels:  # of a path
        stress, zeta = limit.levels[-1].stress, limit.levels[-1].state.zeta
    if stress is None or zeta == 0 or not math.isfinite(zeta):
        return None
    return _forces(problem, stress, zeta)


def _of_bound(body: BodyBounds) -> LimitForces | None:
    """Those of a strict lower bound, if it has a stress that nodal forces balance. Collective."""
    problem, value = body.problem, body.lower.value
    around_axis = problem.tagged_mesh.axisymmetric  # r times the stress is not linear there
    if body.stress is None or around_axis or not body.lower.strict or not value:
        return None
    if body.question is not Question.LIMIT:
        return None
    space = fem.functionspace(problem.tagged_mesh.mesh, ("DG", 1, body.stress.shape[2:]))
    stress = fem.Function(space)
    values = stress.x.array.reshape(-1, body.stress.shape[2])
    values[space.dofmap.list[: len(body.stress)]] = body.stress
    stress.x.scatter_forward()
    found = _forces(problem, stress, float(value))
    # Forces whose rest is larger, relative, are not printed: surfaces of other divisions hand
    # tractions over that nodal forces do not have.
    balanced = 1e-9
    return replace(found, strict=True) if found.balance <= balanced else None


def _forces(problem: Problem, stress: fem.Function, zeta: float) -> LimitForces:
    internal = problem.create_vector()
    assemble_force(internal, fem.form(problem.internal_form(stress)), [])
    pushed = contact_forces(problem, stress, zeta)
    rubbed = friction_forces(problem, stress, zeta)
    found = resultants(problem, internal, pushed, rubbed, zeta)
    internal.destroy()
    return LimitForces(zeta, False, dict(found.forces), dict(found.moments), found.balance)
