"""Forces and moments as ``summary.json`` has them, moments in their unit of the case."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from perfplast_fenicsx.limit_analysis.body.body_bounds import BodyBounds
from perfplast_fenicsx.limit_analysis.body.limit_forces import limit_forces
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitLoad
from perfplast_fenicsx.problem.judged.load_resultants import load_resultants
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.units import Units


class ResultantTables:
    """Tables of what loads and supports exert."""

    def __init__(self, units: Units, whole: bool) -> None:
        """Take the units.

        Args:
            units: Of the case; without a system moments are force × length as the case has them.
            whole: As for :meth:`units.Units.table`.
        """
        self._scale = units.moment_scale(whole)

    def loads(self, problem: Problem) -> list[dict[str, Any]]:
        """Of each load at ζ = 1. Collective."""
        found = load_resultants(problem)
        return [asdict(load) | {"moment": self._told(load.moment)} for load in found]

    def at_limit(
        self, problem: Problem, limit: LimitLoad, body: BodyBounds | None
    ) -> dict[str, Any] | None:
        """Of loads and supports, as :func:`limit_forces.limit_forces` finds them. Collective."""
        found = limit_forces(problem, limit, body)
        if found is None:
            return None
        moments = {name: self._told(moment) for name, moment in found.moments.items()}
        return asdict(found) | {"moments": moments}

    def _told(self, moment: Sequence[float]) -> list[float]:
        return [self._scale * number for number in moment]
