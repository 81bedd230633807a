"""Compute bounds on the limit load that hold for the bodies themselves, not only for the mesh."""

from dataclasses import dataclass, replace
from typing import Any, Literal

from perfplast_fenicsx.controls.control import Given, OfBody, Run, of_other_loads
from perfplast_fenicsx.limit_analysis.body.adaptive_meshes import (
    adaptive_bounds,
    check_turns,
    least_load,
    zero_is_outside,
)
from perfplast_fenicsx.limit_analysis.body.body_bounds import BodyBounds
from perfplast_fenicsx.limit_analysis.body.limit_bounds import check_bounds, limit_bounds
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitLoad
from perfplast_fenicsx.limit_analysis.statements.limit_checks import check_tolerance
from perfplast_fenicsx.limit_analysis.statements.load_factor import Question, check_design
from perfplast_fenicsx.problem.problem import Problem


@dataclass(frozen=True)
class BoundsControl(OfBody):
    """Bounds on the limit load that hold for the bodies, not only for their mesh.

    Args:
        limit_tolerance: Permitted relative distance of each bound from the best of its kind on this
            mesh, between 0 and 1. On the meshes of a refinement, a twentieth of the previous gap is
            sufficient.
        design: Load factor of the design load, often 1.0; results report the ratio of the limit
            load to the design load.
        direction: "up" computes the largest load factor that the bodies carry, and also the
            smallest load factor if the bodies do not carry the constant loads alone; "both" always
            computes both.

    Raises:
        InputError: For a tolerance or a load factor that is not valid.
    """

    limit_tolerance: float = 1e-4
    design: float | None = None
    direction: Literal["up", "both"] = "up"

    def __post_init__(self) -> None:
        check_tolerance(self.limit_tolerance)
        check_design(self.design)

    def check(self, given: Given) -> None:
        """Refuse moving obstacles, and cases in which no load acts or nothing limits the load.

        If ``direction`` is "both", also refuse the forces of pins, which cannot be reversed.
        """
        given.require_load()
        given.require_limit()
        given.refuse_moves()
        if self.direction == "both":
            check_turns(given.loads)

    def admit(self, problem: Problem, solver: Any) -> None:
        """Refuse problems for which bounds of the body are not available. Collective."""
        check_bounds(problem, self.limit_tolerance)

    def find(self, run: Run) -> LimitLoad:
        """Compute the bounds, on one mesh or on several adapted meshes. Collective."""
        problem, record = run.problem, run.record
        if run.adapt is None:
            found, body = None, limit_bounds(problem, self.limit_tolerance, record.interior)
        else:
            told = (record.mesh, record.interior)
            asked = (self.limit_tolerance, *told, self.design)
            found = adaptive_bounds(problem, run.adapt, *asked, record.so_far)
            body = found.body
        with of_other_loads(found):  # loads with opposite signs
            body = self._with_least(run, body)
        mesh = found.best.mesh if found else body.mesh
        record.limit(mesh, body, found)
        return mesh

    def _with_least(self, run: Run, body: BodyBounds) -> BodyBounds:
        """Return ``body``, with bounds on the smallest load factor if they are needed.

        Collective.
        """
        asked = self.direction == "both" and body.question is Question.LIMIT
        told = run.record.interior
        if asked or zero_is_outside(run.problem, body, told):
            least = least_load(run.problem, self.limit_tolerance, run.adapt, told)
            return replace(body, least=least)
        return body
