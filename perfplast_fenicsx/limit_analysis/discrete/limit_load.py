"""Define the result of a search for a limit load, and choose the method that suits a problem."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any

from dolfinx import fem

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.limit_analysis.conic.interior_steps import InteriorStep, Verdict
from perfplast_fenicsx.limit_analysis.discrete.body_cones import has_cones
from perfplast_fenicsx.limit_analysis.statements.limit_checks import collapses_by_loads
from perfplast_fenicsx.limit_analysis.statements.load_factor import (
    DruckerBounds,
    Question,
    Standing,
)
from perfplast_fenicsx.problem.judged.state import Level, LoadingPath
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.tables import COLOURS, NotebookResult, Row


class LimitMethod(StrEnum):
    """Method of the search: directly, or by a loading path that levels off."""

    INTERIOR_POINT = "interior-point"
    PATH = "path"


@dataclass(frozen=True)
class LimitLoad(NotebookResult):
    """The result of a search for the limit load ζ_lim of a mesh.

    Attributes:
        method: The method that found it.
        lower: Static side of the mesh, not a bound of the body: factor of a stress in equilibrium
            on the mesh and within yield, or the largest ζ(α) reached. −∞ with permanent loads if
            none is known.
        estimate: Limit load of the mesh, between both sides: an estimate for the body. None without
            a result, or without a kinematic side and a plateau.
        residual: Relative change of the estimate with the last level; None without two estimates.
        upper: Kinematic side of the mesh, not a bound of the body: (D(v) − L₀(v))/L₁(v) of a
            mechanism that is incompressible on the mesh; None without a mechanism.
        alpha: Work reached by the path; None without a path.
        levelled_off: Whether the estimate is known to the tolerance: both sides have met, or ζ(α)
            has levelled off.
        reason: Why the search ended, in words.
        iterations: Steps of the interior point method, or levels.
        linear_solves: Linear systems solved, for both sides together.
        factorisations: Factorisations of the interior point method.
        mechanism: Velocity v of the collapse, normalised to L₁(v) = 1.
        levels: The loading path; after a restart only the later levels.
        stress: σ at the static side, Mandel vectors at the quadrature points; None for a path,
            whose levels have their stresses.
        contact_forces: Contact forces with that stress, of the pairs hosted by this rank.
        unbalanced: Largest unbalanced force there, relative to the largest load; ∞ without a
            stress.
        inadmissible: Volume change of the mechanism in plastic bodies, and strain in elastic ones,
            relative to ‖ε(v)‖; None for a path.
        verdict: Verdict of the interior point method; None for a path.
        steps: Steps of the interior point method; empty for a path.
        theorem: Whether limit theorems hold. With Coulomb's friction they do not
            (:mod:`limit_search`). ``lower`` is then the largest load that levels of this path
            carry, and ``estimate`` the same if the search has ended. ``upper`` is the least load
            without equilibrium. Neither bounds anything else.
        drucker: Drucker's two bounds with Coulomb's friction; None if not sought.
        locked: Bodies that keep the interior point method from a mechanism, if it found none.
        question: The loads whose factor was sought. These are the permanent loads if no load grows,
            or if no load factor is carried together with them; the mechanism then belongs to them.
        standing: Multiple of the permanent loads that is carried, if sought.
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
        """Whether there is a mechanism, possibly just the final velocity of a path."""
        known: tuple[float | None, ...] = (self.upper, self.estimate)
        if self.question is Question.STANDS and self.standing is not None:
            known = (self.standing.upper,)
        return self.method is LimitMethod.PATH or any(value is not None for value in known)

    def in_words(self) -> str:
        """Return the result in a sentence."""
        if self.estimate is None:
            return f"No limit load of this mesh was found: {self.reason}."
        words = f"The limit load of this mesh is {self.estimate:.6g}, an estimate for the bodies"
        return f"{words}; the search ended: {self.reason}."

    def rows(self) -> list[Row]:
        """Return a row for each level of a path, or for each step of the interior point method.

        Columns are those of :class:`~report.LevelReport` or of :class:`InteriorStep`.
        """
        if self.method is LimitMethod.PATH:
            return LoadingPath(self.levels).rows()
        return [asdict(step) for step in self.steps]

    def draw_into(self, axes: Any) -> None:
        """Draw the load factor over work or steps, and both sides of the mesh."""
        if self.method is LimitMethod.PATH:
            LoadingPath(self.levels).draw_into(axes)
        else:
            axes.plot([it.number for it in self.steps], [it.load for it in self.steps], "o-")
            axes.set(xlabel="step", ylabel="load factor")
            axes.grid(alpha=0.3)
        for side, value in (("lower", self.lower), ("upper", self.upper)):
            if value is not None and math.isfinite(value):
                axes.axhline(value, ls="--", color=COLOURS[side], label=f"{side} side of the mesh")
        axes.legend()

    def __repr__(self) -> str:
        numbers = {"lower": self.lower, "estimate": self.estimate, "upper": self.upper}
        told = (f"{name}={'none' if x is None else f'{x:.6g}'}" for name, x in numbers.items())
        steps = "levels" if self.method is LimitMethod.PATH else "steps"
        return f"LimitLoad({', '.join(told)}; {self.iterations} {steps}; {self.reason})"


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
        raise InputError(f"{found.reason}; reverse the loads, or support the bodies there.")
    return found
