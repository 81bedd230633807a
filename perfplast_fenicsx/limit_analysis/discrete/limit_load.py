"""The result of a search for a limit load, by either of the two methods."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

from dolfinx import fem

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.conic.interior_steps import InteriorStep, Verdict
from perfplast_fenicsx.limit_analysis.statements.drucker_bounds import DruckerBounds
from perfplast_fenicsx.limit_analysis.statements.question import Question
from perfplast_fenicsx.limit_analysis.statements.standing import Standing
from perfplast_fenicsx.problem.judged.state import Level


class LimitMethod(StrEnum):
    """How a limit load is found: directly, or where a loading path levels off."""

    INTERIOR_POINT = "interior-point"
    PATH = "path"


@dataclass(frozen=True)
class LimitLoad:
    """The result of a search for ζ_lim.

    Attributes:
        method: How it was found.
        lower: The static side of the mesh, and no bound of the body: λ of a stress in equilibrium
            on the mesh and within yield, or the largest ζ(α) reached; −∞ where constant loads are
            there, and none is known.
        estimate: The limit load of the mesh, between both sides: an estimate of that of the body.
            None where there is none, or no kinematic side and no plateau was found.
        residual: Change of the estimate with the last level, relative; None without two estimates,
            as without a path.
        upper: The kinematic side of the mesh, and no bound of the body: (D(v) − L₀(v))/L₁(v) of a
            mechanism that is incompressible on the mesh; None where none was found.
        alpha: Work reached by the path; None without one.
        levelled_off: Whether the estimate is known to the tolerance: both sides have met, or ζ(α)
            has levelled off.
        reason: Why it ended, in words.
        iterations: Steps of the interior point method, or levels.
        linear_solves: Linear systems solved for all of it, both sides included.
        factorisations: Of the interior point method.
        mechanism: Velocity v of the collapse, normalised to L₁(v) = 1.
        levels: The loading path; after a restart only the later levels.
        stress: σ at the static side, Mandel vectors at the quadrature points; None of a path, whose
            levels have theirs.
        contact_forces: Of the pairs hosted by this rank, with that stress.
        unbalanced: Largest force there that nothing balances, relative to the largest load; ∞ of
            none.
        inadmissible: Volume change of the mechanism in plastic bodies, and strain in elastic ones,
            relative to ‖ε(v)‖; None of a path.
        verdict: Of the interior point method; None of a path.
        steps: Of the same; none of a path.
        theorem: Whether limit theorems hold. With Coulomb's friction they do not: ``lower`` is then
            the largest load that levels of this path carry, ``estimate`` the same where the search
            has come to its end, and ``upper`` the least with a verdict that there is no equilibrium
            (:mod:`coulomb_search`); neither is a bound of anything else.
        drucker: Beside such a load, what two theorems say of all of its kind; None where they have
            not been asked.
        locked: Bodies that keep the interior point method from a mechanism, where it found none.
        question: Of which loads the factor was sought: that of constant ones, where no load grows,
            or no load factor is carried beside them. The mechanism is theirs then.
        standing: How many times they are carried, where that was sought.
    """

    method: LimitMethod
    lower: float
    estimate: float | None
    residual: float | None
    upper: float | None
    alpha: float | None
    levelled_off: bool
    reason: str
    iterations: int
    linear_solves: int
    factorisations: int | None
    mechanism: fem.Function
    levels: Sequence[Level] = ()
    stress: fem.Function | None = None
    contact_forces: Floats | None = None
    unbalanced: float = math.inf
    inadmissible: float | None = None
    verdict: Verdict | None = None
    steps: Sequence[InteriorStep] = ()
    theorem: bool = True
    drucker: DruckerBounds | None = None
    locked: tuple[str, ...] = ()
    question: Question = Question.LIMIT
    standing: Standing | None = None

    @property
    def collapses(self) -> bool:
        """Whether there is a mechanism, if only the velocity that a path ends with."""
        known: tuple[float | None, ...] = (self.upper, self.estimate)
        if self.question is Question.STANDS and self.standing is not None:
            known = (self.standing.upper,)
        return self.method is LimitMethod.PATH or any(value is not None for value in known)

    def __repr__(self) -> str:
        numbers = {"lower": self.lower, "estimate": self.estimate, "upper": self.upper}
        told = (f"{name}={'none' if x is None else f'{x:.6g}'}" for name, x in numbers.items())
        steps = "levels" if self.method is LimitMethod.PATH else "steps"
        return f"LimitLoad({', '.join(told)}; {self.iterations} {steps}; {self.reason})"
