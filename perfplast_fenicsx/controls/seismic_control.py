"""Compute bounds on the critical seismic coefficient."""

from dataclasses import dataclass
from typing import Any, ClassVar

from perfplast_fenicsx.controls.bounds_control import BoundsControl
from perfplast_fenicsx.controls.control import Given, OfBody, Run
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitLoad
from perfplast_fenicsx.limit_analysis.statements.limit_checks import check_tolerance
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.rounding import rounded_down, rounded_up


@dataclass(frozen=True)
class SeismicControl(OfBody):
    """Bounds on the critical seismic coefficient k_c.

    The force of ``[earthquake]`` is k times the weight; k_c is the largest k at which the ground
    does not collapse. All other loads are constant.

    Args:
        limit_tolerance: Permitted relative distance of each bound from the best of its kind on this
            mesh, between 0 and 1.

    Raises:
        InputError: For a tolerance that is not valid.
    """

    design: ClassVar[None] = None

    limit_tolerance: float = 1e-4

    def __post_init__(self) -> None:
        check_tolerance(self.limit_tolerance)

    @property
    def _bounds(self) -> BoundsControl:
        return BoundsControl(self.limit_tolerance)

    def check(self, given: Given) -> None:
        """Refuse cases that ``control = 'bounds'`` refuses."""
        self._bounds.check(given)

    def admit(self, problem: Problem, solver: Any) -> None:
        """Refuse problems for which bounds of the body are not available. Collective."""
        self._bounds.admit(problem, solver)

    def find(self, run: Run) -> LimitLoad:
        """Compute the bounds on k_c. Collective."""
        return self._bounds.find(run)

    def answer(self, lower: float | None, upper: float | None) -> str:
        """Return a sentence on the bounds of k_c; empty if no upper or positive lower is known."""
        if upper is not None and upper <= 0:
            return "The bodies collapse without an earthquake, so no critical coefficient exists."
        sides = []
        if lower is not None and lower > 0:
            sides.append(f"are stable at k = {rounded_down(lower)} for certain")
        if upper is not None:
            sides.append(f"collapse at k = {rounded_up(upper)} at the latest")
        force = "under a horizontal force of k times their weight"
        return f"The bodies {', and '.join(sides)}, {force}." if sides else ""
