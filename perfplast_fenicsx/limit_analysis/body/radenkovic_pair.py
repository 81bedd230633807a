"""Bodies between whose limit loads those of ground lie that dilates by less than its friction."""

from perfplast_fenicsx.materials.nonassociated_flow import pair_of
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.problem.variant import variant


def weaker_and_stronger(problem: Problem) -> tuple[Problem, Problem]:
    """The bodies of which a lower and an upper bound are sought. Collective.

    Both are on the mesh of the problem, and associated (:mod:`nonassociated_flow`).

    Args:
        problem: The bodies as they were declared.

    Returns:
        The problem twice, where each limit load is that of the bodies themselves.
    """
    pair = pair_of(problem.given.materials)
    if pair is None:
        return problem, problem
    below, above = (variant(problem, materials=materials) for materials in pair)
    return below, above
