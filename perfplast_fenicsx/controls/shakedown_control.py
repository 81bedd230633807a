"""Compute the largest multiple of repeated variable loads for which the bodies shake down."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from perfplast_fenicsx.controls.control import Given, OfBody, Run
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitLoad
from perfplast_fenicsx.limit_analysis.shakedown.elastic_stresses import (
    LoadDomain,
    check_elastic,
    check_names,
)
from perfplast_fenicsx.limit_analysis.shakedown.shakedown_load import (
    check_directions,
    check_shakedown,
    shakedown_diagram,
    shakedown_load,
)
from perfplast_fenicsx.limit_analysis.statements.limit_checks import check_tolerance
from perfplast_fenicsx.problem.declared.initial import Temperature
from perfplast_fenicsx.problem.declared.stage import called
from perfplast_fenicsx.problem.problem import Problem


@dataclass(frozen=True)
class ShakedownControl(OfBody):
    """Loads and temperatures that vary repeatedly and arbitrarily within ranges.

    The program computes the largest multiple of these ranges for which the bodies shake down: by
    Melan's theorem, they respond elastically after some plastic flow. The result is an estimate,
    because the elastic stresses come from the finite element solution. Bodies in contact must be
    tied. Constant loads act all the time.

    Args:
        ranges: Smallest and largest factor of each load and change of temperature, by its name. A
            load without a name has the name of its surface; a temperature without a name has the
            name of its volume. Each load varies independently.
        corners: Alternative to ``ranges``: factors that act together, one table for each corner of
            the load domain. A load that a table does not name is zero at that corner. All
            combinations in the convex hull of the corners also occur.
        directions: Number of additional ratios of the two loads (at least 3), for a shakedown
            diagram; requires exactly two names.
        limit_tolerance: Permitted relative difference between Melan's and Koiter's values, between
            0 and 1.

    Raises:
        InputError: If both or neither of ``ranges`` and ``corners`` are given, or if nothing
            varies.
    """

    design: ClassVar[None] = None
    of_body: ClassVar[bool] = False
    together: ClassVar[bool] = False

    ranges: dict[str, list[float]] | None = None
    corners: list[dict[str, float]] | None = None
    directions: int = 0
    limit_tolerance: float = 1e-4

    def __post_init__(self) -> None:
        check_tolerance(self.limit_tolerance)
        if (self.ranges is None) == (self.corners is None):
            what = "neither ranges nor" if self.ranges is None else "both ranges and"
            raise InputError(
                f"[loading] has {what} corners; give the varying factors either as ranges = {{ "
                "pressure = [0, 1] }, or as corners."
            )
        check_directions(self.domain, self.directions)

    @property
    def domain(self) -> LoadDomain:
        """Return the domain in which the loads vary."""
        if self.ranges is not None:
            return LoadDomain.of_ranges(self.ranges)
        return LoadDomain.of_corners(self.corners or [])

    def check(self, given: Given) -> None:
        """Refuse unknown names, loads without a range, motions, contacts and obstacles."""
        given.require_load(enough=given.strained)
        given.refuse_moves()
        warmed = [called(a) for a in given.initial if isinstance(a, Temperature)]
        check_names(given.loads, warmed, self.domain.names)
        check_elastic(given.materials)
        if given.contacts or given.obstacles:
            raise InputError(
                "control = 'shakedown' superposes the elastic stresses of the separate loads, so "
                "bodies may neither separate nor slide; use [[tie]] tables in place of contacts "
                "that stay closed, and supports in place of obstacles."
            )
        if given.settled or given.moving:
            raise InputError(
                "control = 'shakedown' supports only loads and temperatures, but a "
                "support or a rigid surface moves; remove its motion."
            )

    def remarks(self, problem: Problem) -> Sequence[str]:
        """Return, if there are bolts, a remark that preloads have no effect; otherwise nothing."""
        if not problem.shanks.bolts:
            return ()
        return [
            "preloads of bolts are self-equilibrated stresses; they do not change the "
            "shakedown load and are ignored"
        ]

    def admit(self, problem: Problem, solver: Any) -> None:
        """Refuse laws without a conic yield set, and bodies that may separate. Collective."""
        check_shakedown(problem, self.domain, self.limit_tolerance)

    def find(self, run: Run) -> LimitLoad:
        """Compute the shakedown load, and the diagram if ``directions`` is not 0. Collective."""
        rtol, steps = self.limit_tolerance, run.record.interior
        found = shakedown_load(run.problem, self.domain, rtol, steps)
        diagram = []
        if self.directions:
            told = (self.domain, self.directions, rtol)
            diagram = shakedown_diagram(run.problem, *told, steps=steps)
        run.record.shakedown(found, diagram)
        return found.as_limit()
