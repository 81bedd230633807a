"""Bounds of the load that bodies with Coulomb's friction carry: Drucker's two theorems.

No limit theorem holds for Coulomb's friction, as slip does not follow the normal of the friction
cone. But a body carries no less than without any friction, and no more than if nothing could slip
or part where there is friction: both are limit loads of perfect plasticity (D. C. Drucker, Coulomb
friction, plasticity, and limit loads, J. Appl. Mech. 21 (1954), 71).
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from perfplast_fenicsx.limit_analysis.discrete.discrete_limit import (
    DiscreteLimit,
    Verdict,
    interior_point,
)
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.problem.variant import variant
from perfplast_fenicsx.rounding import rounded_down, rounded_up


@dataclass(frozen=True)
class DruckerBounds:
    """What a mesh carries with Coulomb's friction.

    Attributes:
        lower: Limit load without friction, at least; 0 where nothing but friction holds the bodies.
        upper: Limit load where nothing slips or parts, at most; infinite where nothing seems to
            bound that, None where it was not found.
    """

    lower: float
    upper: float | None

    def in_words(self) -> str:
        """What they say, in a sentence."""
        least = f"collapse or slide at no load below {rounded_down(self.lower)}, the limit load"
        least += " without friction"
        finite = self.upper is not None and math.isfinite(self.upper)
        # A lower bound below this share of the upper one is the rounding of 0: the interior point
        # method ends where sides are no farther apart.
        rounding = 1e-6
        if self.lower <= rounding * (self.upper if finite and self.upper else 0.0):
            least = "may slide at any load, as without friction they carry none"
        tied = "if nothing slipped or parted where they rub"
        if self.upper is None:
            most = f"; the limit load {tied} was not found"
        elif not finite:
            most = f", and would carry any load {tied}"
        else:
            most = (
                f", and collapse at {rounded_up(self.upper)} at the latest, the limit load {tied}"
            )
        return (
            f"with Coulomb's friction the bodies of this mesh {least}{most} (Drucker); no other"
            " limit theorem holds"
        )

    def table(self) -> dict[str, Any]:
        """The bounds and their words, as ``summary.json`` has them."""
        return {"lower": self.lower, "upper": self.upper, "words": self.in_words()}


def drucker_bounds(problem: Problem) -> DruckerBounds:
    """Find both. Collective.

    Raises:
        InputError: As :func:`discrete_limit.interior_point`.
    """
    smooth, tied = (interior_point(make(problem)) for make in (without_friction, without_slip))
    return DruckerBounds(_carried(smooth), _borne(tied))


def _carried(found: DiscreteLimit) -> float:
    unheld = found.verdict is Verdict.NO_RESISTANCE or found.lower is None
    return 0.0 if unheld else max(found.lower or 0.0, 0.0)


def _borne(found: DiscreteLimit) -> float | None:
    known = {Verdict.UNBOUNDED: math.inf, Verdict.NO_RESISTANCE: 0.0}
    return known.get(found.verdict, found.upper)


def without_friction(problem: Problem) -> Problem:
    """The same problem, of which nothing rubs. Collective."""
    return variant(problem, friction=problem.friction.smooth())


def without_slip(problem: Problem) -> Problem:
    """The same problem, in which nothing slips or parts where it rubs. Collective."""
    basis, friction = problem.basis, problem.friction
    parts = np.ones(len(basis.index), dtype=np.bool_)
    parts[friction.pair] = False
    held = np.concatenate([basis.tied, basis.index[~parts], basis.sliding])
    none = np.zeros(0, dtype=np.int32)
    glued = replace(basis.holding(held, parts), sliding=none)
    return variant(problem, basis=glued, friction=friction.nowhere())
