"""How many times loads that vary again and again may grow before bodies no longer adapt."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from perfplast_fenicsx.controls.control import OfBody, Run
from perfplast_fenicsx.controls.given import Given
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitLoad
from perfplast_fenicsx.limit_analysis.shakedown.diagram import (
    check_directions,
    shakedown_diagram,
)
from perfplast_fenicsx.limit_analysis.shakedown.elastic_stresses import check_names
from perfplast_fenicsx.limit_analysis.shakedown.load_domain import LoadDomain
from perfplast_fenicsx.limit_analysis.shakedown.shakedown_load import (
    check_shakedown,
    shakedown_load,
)
from perfplast_fenicsx.limit_analysis.statements.limit_checks import check_tolerance
from perfplast_fenicsx.problem.declared.initial import Temperature
from perfplast_fenicsx.problem.declared.stage import called
from perfplast_fenicsx.problem.problem import Problem


@dataclass(frozen=True)
class ShakedownControl(OfBody):
    """No loading: loads and temperatures vary as they like, again and again.

    What is sought is the largest multiple of what they vary in that the bodies shake down to:
    after some flow they answer elastically, by Melan's theorem. It is an estimate, since elastic
    stresses are those of the mesh. Bodies that touch are tied; constant loads are there all the
    time.

    Args:
        ranges: Least and largest factor of each load and change of temperature, by their names, or
            by their surfaces or volumes where they have none. Each varies by itself.
        corners: In place of it, factors of what occurs together, a table for each; what one does
            not name is zero there, and anything between them occurs too.
        directions: With two names: of how many ratios of both the load is found besides, for a
            diagram of shakedown.
        limit_tolerance: How near Melan's and Koiter's value come to each other, relative, between 0
            and 1.

    Raises:
        InputError: Neither or both of ``ranges`` and ``corners``, or such that nothing varies.
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
                f"there is {what} corners; give what varies as ranges = {{ pressure = [0, 1] }}, or"
                " as corners."
            )
        check_directions(self.domain, self.directions)

    @property
    def domain(self) -> LoadDomain:
        """Return the domain of the loads."""
        if self.ranges is not None:
            return LoadDomain.of_ranges(self.ranges)
        return LoadDomain.of_corners(self.corners or [])

    def check(self, given: Given) -> None:
        """Refuse unknown names, loads without a range, and contacts that may open or slide."""
        given.require_load(enough=given.strained)
        given.refuse_moves()
        warmed = [called(a) for a in given.initial if isinstance(a, Temperature)]
        check_names(given.loads, warmed, self.domain.names)
        if given.contacts or given.obstacles:
            raise InputError(
                "control = 'shakedown' is for bodies that neither part nor slide, since it adds up"
                " elastic stresses of single loads; make contacts that stay closed [[tie]] tables,"
                " and obstacles supports."
            )
        if given.settled or given.moving:
            raise InputError(
                "control = 'shakedown' is for loads and temperatures, and a support or a rigid"
                " surface moves; let it rest."
            )

    def remarks(self, problem: Problem) -> Sequence[str]:
        """That preloads do not count, if there are any; temperatures do."""
        if not problem.shanks.bolts:
            return ()
        return [
            "preloads of bolts are residual stress: they change no shakedown load, and are ignored"
        ]

    def admit(self, problem: Problem, solver: Any) -> None:
        """Refuse laws without a cone, and contacts that may open. Collective."""
        check_shakedown(problem, self.domain, self.limit_tolerance)

    def find(self, run: Run) -> LimitLoad:
        """Find the shakedown load, or the loads of a diagram. Collective."""
        rtol, steps = self.limit_tolerance, run.record.interior
        found = shakedown_load(run.problem, self.domain, rtol, steps)
        diagram = []
        if self.directions:
            told = (self.domain, self.directions, rtol)
            diagram = shakedown_diagram(run.problem, *told, steps=steps)
        run.record.shakedown(found, diagram)
        return found.as_limit()
