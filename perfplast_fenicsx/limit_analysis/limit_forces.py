"""Forces of loads, supports, obstacles and contacts at the limit load of a mesh."""

import math
from dataclasses import dataclass

from dolfinx import fem

from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitLoad
from perfplast_fenicsx.problem.assembled.integrals import assemble_force
from perfplast_fenicsx.problem.judged.certificate import contact_forces, friction_forces
from perfplast_fenicsx.problem.judged.resultants import resultants
from perfplast_fenicsx.problem.problem import Problem


@dataclass(frozen=True)
class LimitForces:
    """What the stress at the limit load is in balance with.

    Attributes:
        zeta: Load factor that the stress carries, the static side of the limit load of the mesh.
        reactions: As of a level (:class:`resultants.Resultants`). Where supports or contacts can
            share a force in several ways, these are one of them.
        moments: Of the loads and of supports about the origin.
        balance: As of a level.
    """

    zeta: float
    reactions: dict[str, list[float]]
    moments: dict[str, list[float]]
    balance: float


def limit_forces(problem: Problem, limit: LimitLoad) -> LimitForces | None:
    """The forces of a limit load that the interior point method has found. Collective.

    Args:
        problem: On whose mesh it was found.
        limit: With its stress.

    Returns:
        None where there is no stress, or it carries nothing.
    """
    if limit.stress is None or limit.lower == 0 or not math.isfinite(limit.lower):
        return None
    internal, zeta = problem.create_vector(), limit.lower
    assemble_force(internal, fem.form(problem.internal_form(limit.stress)), [])
    pushed = contact_forces(problem, limit.stress, zeta)
    rubbed = friction_forces(problem, limit.stress, zeta)
    found = resultants(problem, internal, pushed, rubbed, zeta)
    internal.destroy()
    return LimitForces(zeta, dict(found.forces), dict(found.moments), found.balance)
