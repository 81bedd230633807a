"""Compute Drucker's bounds of the load that bodies with Coulomb's friction carry.

No limit theorem holds for Coulomb's friction, as slip does not follow the normal of the friction
cone. But a body carries no less than without any friction. It carries no more than if surfaces with
friction could neither slip nor separate. Both are limit loads of perfect plasticity (D. C. Drucker,
Coulomb friction, plasticity, and limit loads, J. Appl. Mech. 21 (1954), 71).
"""

import math
from dataclasses import replace

import numpy as np

from perfplast_fenicsx.limit_analysis.conic.interior_steps import Verdict
from perfplast_fenicsx.limit_analysis.discrete.discrete_limit import interior_point
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitLoad
from perfplast_fenicsx.limit_analysis.statements.drucker_bounds import DruckerBounds
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.problem.variant import variant


def drucker_bounds(problem: Problem) -> DruckerBounds:
    """Compute both bounds. Collective.

    Raises:
        InputError: As :func:`discrete_limit.interior_point`.
    """
    smooth, tied = (interior_point(make(problem)) for make in (without_friction, without_slip))
    return DruckerBounds(_carried(smooth), _borne(tied))


def _carried(found: LimitLoad) -> float:
    return 0.0 if found.verdict is Verdict.NO_RESISTANCE else max(found.lower, 0.0)


def _borne(found: LimitLoad) -> float | None:
    known: dict[Verdict | None, float] = {Verdict.UNBOUNDED: math.inf, Verdict.NO_RESISTANCE: 0.0}
    return known.get(found.verdict, found.upper)


def without_friction(problem: Problem) -> Problem:
    """Return the same problem without friction. Collective."""
    return variant(problem, friction=problem.friction.smooth())


def without_slip(problem: Problem) -> Problem:
    """Return the same problem, glued where there is friction. Collective."""
    basis, friction = problem.basis, problem.friction
    parts = np.ones(len(basis.index), dtype=np.bool_)
    parts[friction.pair] = False
    held = np.concatenate([basis.tied, basis.index[~parts], basis.sliding])
    none = np.zeros(0, dtype=np.int32)
    glued = replace(basis.holding(held, parts), sliding=none)
    return variant(problem, basis=glued, friction=friction.nowhere())
