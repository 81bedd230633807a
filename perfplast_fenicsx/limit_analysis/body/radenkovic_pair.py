"""Create the bodies whose limit loads bound those of the declared bodies.

They differ for ground with ψ < φ, and for pore pressures with kinks in cells.
"""

from perfplast_fenicsx.limit_analysis.facets.enclosed_pores import with_enclosed_pores
from perfplast_fenicsx.materials.nonassociated_flow import pair_of
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.problem.variant import variant


def weaker_and_stronger(problem: Problem) -> tuple[Problem, Problem]:
    """Return the bodies for a lower and for an upper bound. Collective.

    Both are on the mesh of the problem, and associated (:mod:`nonassociated_flow`).

    Args:
        problem: The bodies as they were declared.

    Returns:
        The same problem twice, if each limit load is that of the bodies themselves.
    """
    pair = pair_of(problem.given.materials)
    below = above = problem
    if pair is not None:
        below, above = (variant(problem, materials=materials) for materials in pair)
    return with_enclosed_pores(below, "above"), with_enclosed_pores(above, "below")
