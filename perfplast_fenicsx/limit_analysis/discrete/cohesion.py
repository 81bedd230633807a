"""Check that loads determine the strength of ground without cohesion."""

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.limit_analysis.discrete.body_cones import body_cones
from perfplast_fenicsx.problem.problem import Problem


def check_cohesion(problem: Problem) -> None:
    """Refuse ground without cohesion if no load determines its strength. Collective.

    Raises:
        InputError: Unless some loads are permanent and some grow.
    """
    grows, stays = problem.loads.grows(), problem.loads.has_dead()
    if body_cones(problem).all_loose and not (grows and stays):
        raise InputError(
            "cohesion = 0: ground without cohesion has strength only where a constant load "
            "compresses it, and unless some loads are constant and others grow, its limit load "
            "is zero or infinite; give constant loads and one that grows, or a small cohesion."
        )
