"""Choose the method that suits a problem, and check that loads are resisted."""

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.limit_analysis.conic.interior_steps import Verdict
from perfplast_fenicsx.limit_analysis.discrete.body_cones import has_cones
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitLoad, LimitMethod
from perfplast_fenicsx.limit_analysis.statements.limit_checks import collapses_by_loads
from perfplast_fenicsx.problem.problem import Problem

MOST_UNKNOWNS = {2: 1_000_000, 3: 300_000}
"""Largest number of unknowns, by dimension, with which 20 factorisations are faster than a path."""


TOLERANCE = 1e-3
"""Default relative distance of the bounds of a limit load."""


def method_for(problem: Problem) -> LimitMethod:
    """Return the interior point method if it supports laws and loads of a small enough problem."""
    if not collapses_by_loads(problem):
        return LimitMethod.PATH
    small = problem.num_dofs <= MOST_UNKNOWNS[problem.bodies.gdim]
    return LimitMethod.INTERIOR_POINT if small and has_cones(problem) else LimitMethod.PATH


def resisted(found: LimitLoad) -> LimitLoad:
    """Return the result of the interior point method if something resists the loads.

    Raises:
        InputError: If no stress can carry them.
    """
    if found.verdict is Verdict.NO_RESISTANCE:
        raise InputError(f"{found.reason}; turn the loads around, or hold the bodies there.")
    return found
