"""Compute forces of loads, supports, obstacles and contacts at the limit load."""

import math
from dataclasses import dataclass, replace

from dolfinx import fem

from perfplast_fenicsx.limit_analysis.body.body_bounds import BodyBounds
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitLoad
from perfplast_fenicsx.limit_analysis.statements.question import Question
from perfplast_fenicsx.problem.assembled.spaces import assemble_force
from perfplast_fenicsx.problem.judged.certificate import contact_forces, friction_forces
from perfplast_fenicsx.problem.judged.resultants import resultants
from perfplast_fenicsx.problem.problem import Problem


@dataclass(frozen=True)
class LimitForces:
    """Forces in balance with a stress.

    Attributes:
        zeta: Load factor that the stress carries.
        strict: Whether it is the strict lower bound of the body. Otherwise it is the static side of
            the limit load of the mesh, an estimate, or the last level of a path to it.
        reactions: Reactions as for a level (:class:`resultants.Resultants`). If supports or
            contacts can share a force in several ways, the result is one of them.
        moments: Moments of the loads and of supports about the origin.
        balance: Balance as for a level.
    """

    zeta: float
    strict: bool
    reactions: dict[str, list[float]]
    moments: dict[str, list[float]]
    balance: float


def limit_forces(
    problem: Problem, limit: LimitLoad, body: BodyBounds | None = None
) -> LimitForces | None:
    """Return the forces of the stress that proves a lower bound, or else of the limit load.

    Collective.

    Args:
        problem: Problem on whose mesh the limit load was found.
        limit: Limit load with its stress.
        body: Bounds with the lower bound, which may be on another mesh.

    Returns:
        None if there is no stress, or if it carries nothing.
    """
    if body is not None and (found := _of_bound(body)) is not None:
        return found
    stress, zeta = limit.stress, limit.lower
    if stress is None and limit.theorem and limit.levels:  # the last level of a path
        stress, zeta = limit.levels[-1].stress, limit.levels[-1].state.zeta
    if stress is None or zeta == 0 or not math.isfinite(zeta):
        return None
    return _forces(problem, stress, zeta)


def _of_bound(body: BodyBounds) -> LimitForces | None:
    """Return the forces of a strict lower bound, if nodal forces balance its stress. Collective."""
    problem, value = body.problem, body.lower.value
    around_axis = (
        problem.tagged_mesh.axisymmetric
    )  # in axisymmetry r times the stress is not linear
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
    # Forces with a larger relative residual are not printed: surfaces with different divisions
    # transfer tractions that nodal forces do not represent.
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
