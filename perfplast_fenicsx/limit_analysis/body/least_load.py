"""Bound the least load factor that is carried, by reversing the growing loads.

With permanent loads the carried factors form an interval, since sets of admissible stresses are
convex. It need not contain 0: a wall may need its prop. If it does not, the bound of the largest
factor alone would be misleading.
"""

from collections.abc import Callable, Sequence

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.limit_analysis.body.adaptation import Adaptation
from perfplast_fenicsx.limit_analysis.body.adaptive_meshes import adaptive_bounds
from perfplast_fenicsx.limit_analysis.body.block_bounds import are_blocks, block_bounds
from perfplast_fenicsx.limit_analysis.body.body_bounds import BodyBounds, LeastLoad
from perfplast_fenicsx.limit_analysis.body.limit_bounds import admitted, limit_bounds
from perfplast_fenicsx.limit_analysis.body.radenkovic_pair import weaker_and_stronger
from perfplast_fenicsx.limit_analysis.discrete.discrete_limit import InteriorStep
from perfplast_fenicsx.limit_analysis.statements.load_factor import Question
from perfplast_fenicsx.limit_analysis.stress.static_bound import strict_lower_bound
from perfplast_fenicsx.problem.declared.loads import Bearing, CosinePressure, Load, scaled
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.problem.variant import variant

Steps = Callable[[InteriorStep], None]


def least_load(
    problem: Problem,
    rtol: float = 1e-4,
    adaptation: Adaptation | None = None,
    steps: Steps | None = None,
) -> LeastLoad:
    """Return bounds of the least load factor that is carried. Collective.

    Args:
        problem: The bodies and their loads.
        rtol: Relative distance of each bound to the best of its kind on its mesh.
        adaptation: How the mesh is adapted for it; None for the mesh of the problem.
        steps: Called on every rank after each step of the interior point method.

    Raises:
        InputError: If the force of a pin grows, which cannot pull, and as
            :func:`limit_bounds.limit_bounds`.
    """
    check_turns(problem.given.loads)
    turned = _turned(problem)
    if adaptation is None:
        found = limit_bounds(turned, rtol, steps)
        return LeastLoad(found, found)
    adapted = adaptive_bounds(turned, adaptation, rtol, steps=steps)
    return LeastLoad(adapted.low, adapted.high)


def zero_is_outside(problem: Problem, body: BodyBounds, steps: Steps | None = None) -> bool:
    """Return whether the bodies may fail to carry the permanent loads without the growing loads.

    Collective.

    The function seeks a stress for the reversed loads on the mesh of the problem. Without such a
    stress they may fail.

    Args:
        problem: The bodies and their loads.
        body: Proven bounds of the largest load factor.
        steps: Called on every rank after each step of the interior point method.
    """
    roughly = 0.1  # only the sign matters
    if body.question is not Question.LIMIT or not (body.lower.strict or body.upper.strict):
        return False
    if not (problem.loads.has_dead() and problem.loads.grows()):
        return False
    if any(map(_pushes, problem.given.loads)):
        return False
    if body.upper.strict and body.upper.value is not None and body.upper.value < 0:
        return True
    turned = admitted(_turned(problem), roughly)
    if are_blocks(turned):
        value = block_bounds(turned, roughly).lower.value
        return value is None or value < 0
    below, _ = weaker_and_stronger(turned)
    found = strict_lower_bound(below, roughly, steps).bound
    return not found.strict or found.value is None or found.value < 0


def check_turns(loads: Sequence[Load]) -> None:
    """Refuse growing loads that cannot be reversed.

    Raises:
        InputError: Naming the first such load.
    """
    for load in filter(_pushes, loads):
        raise InputError(
            f"the load on '{load.on}' is the force of a pin, which pushes and cannot pull, "
            "so that the least load factor cannot be computed; remove direction, or give "
            "a traction."
        )


def _pushes(load: Load) -> bool:
    return isinstance(load, Bearing | CosinePressure) and not load.constant


def _turned(problem: Problem) -> Problem:
    """Return the bodies with the growing loads reversed. Collective."""
    loads = [load if load.constant else scaled(load, -1.0) for load in problem.given.loads]
    return variant(problem, loads=loads)
