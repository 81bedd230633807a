"""Define the result of a search for a limit load, and choose the method for a problem."""

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
    """Method of the search: an interior point method, or a loading path that levels off."""

    INTERIOR_POINT = "interior-point"
    PATH = "path"


@dataclass(frozen=True)
class LimitLoad(NotebookResult):
    """The result of a search for the limit load ζ_lim of a mesh.

    Attributes:
        method: The method that found the result.
        lower: Static side of the mesh, not a bound of the body. It is the load factor of a stress
            that is in equilibrium and in the yield sets on the mesh, or the largest ζ(α) of a path.
            With constant loads, it is −∞ if no stress of this kind is known.
        estimate: Limit load of the mesh, as an estimate for the body; between both sides if both
            are known. None if the search ended without an estimate.
        residual: Relative change of the estimate at the last level; None without two estimates.
        upper: Kinematic side of the mesh, not a bound of the body: (D(v) − L₀(v))/L₁(v) of a
            mechanism that is admissible on the mesh; None without a mechanism.
        alpha: Work at the end of the path; None without a path.
        levelled_off: Whether the estimate is known to the tolerance: both sides have met, or ζ(α)
            has levelled off.
        reason: Why the search ended, in words.
        iterations: Number of steps of the interior point method, or number of levels.
        linear_solves: Number of linear systems solved for both sides together.
        factorisations: Number of factorisations of the interior point method; None for a path.
        mechanism: Collapse velocity v, normalised to L₁(v) = 1.
        levels: The levels of the loading path; after a restart, only the levels since the restart.
        stress: Stress σ of the static side, Mandel vectors at the quadrature points; None for a
            path, because each level of a path contains its stress.
        contact_forces: Contact forces in equilibrium with this stress, at the pairs hosted by this
            rank.
        unbalanced: Largest unbalanced force of this stress, relative to the largest load; ∞ without
            a stress.
        inadmissible: Inadmissible part of the mechanism's strain rates, such as the strain rate in
            elastic bodies, relative to ‖ε(v)‖; None for a path.
        verdict: Verdict of the interior point method; None for a path.
        steps: Steps of the interior point method; empty for a path.
        theorem: Whether limit theorems hold. With Coulomb's friction they do not hold
            (:mod:`limit_search`). ``lower`` is then the largest load among the levels of this path,
            and ``estimate`` is the same load if the search has ended. ``upper`` is the least load
            at which no equilibrium was found. These numbers describe only this path and are not
            bounds.
        drucker: Drucker's two bounds with Coulomb's friction; None if they were not computed.
        locked: Bodies whose locking prevented a mechanism, if the interior point method found no
            mechanism.
        question: The loads with the unknown factor. These are the constant loads if no load grows,
            or if the bodies cannot carry the constant loads at any load factor. The mechanism then
            belongs to the constant loads.
        standing: Multiple of the constant loads that the bodies can carry; None if not computed.
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
        """Return whether the result has a mechanism, possibly only the last velocity of a path."""
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

        The columns are the fields of :class:`~report.LevelReport` or of :class:`InteriorStep`.
        """
        if self.method is LimitMethod.PATH:
            return LoadingPath(self.levels).rows()
        return [asdict(step) for step in self.steps]

    def draw_into(self, axes: Any) -> None:
        """Plot the load factor over the work or the steps, and the mesh's lower and upper load."""
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
"""Largest number of unknowns, by dimension, for which 20 factorisations are faster than a path."""


TOLERANCE = 1e-3
"""Default relative difference between the bounds on a limit load."""


def method_for(problem: Problem) -> LimitMethod:
    """Return the interior point method for small problems that it supports, otherwise the path."""
    if not collapses_by_loads(problem):
        return LimitMethod.PATH
    small = problem.num_dofs <= MOST_UNKNOWNS[problem.bodies.gdim]
    return LimitMethod.INTERIOR_POINT if small and has_cones(problem) else LimitMethod.PATH


def resisted(found: LimitLoad) -> LimitLoad:
    """Return the result unchanged if the bodies resist the loads.

    Raises:
        InputError: If no stress can balance the loads.
    """
    if found.verdict is Verdict.NO_RESISTANCE:
        raise InputError(f"{found.reason}; reverse the loads, or support the bodies there.")
    return found
