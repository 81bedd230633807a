"""Ground without cohesion, and what loads have to be there to tell its strength."""

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.limit_analysis.discrete.body_cones import body_cones
from perfplast_fenicsx.problem.problem import Problem


def check_cohesion(problem: Problem) -> None:
    """Refuse ground without cohesion where no load tells how strong it is. Collective.

    Raises:
        InputError: If loads do not both stay and grow.
    """
    grows, stays = problem.loads.grows(), problem.loads.has_dead()
    if body_cones(problem).all_loose and not (grows and stays):
        raise InputError(
            "cohesion = 0: ground without cohesion is as strong as constant loads press it, and"
            " beside none, or nothing but these, it carries any load of a kind or none; give one"
            " load that grows beside constant ones, or a small cohesion."
        )
