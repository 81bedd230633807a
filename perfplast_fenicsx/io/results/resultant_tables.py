"""Format forces and moments for ``summary.json``, with moments in the case's unit."""

from collections.abc import Iterable, Sequence
from dataclasses import asdict
from typing import Any

from mpi4py import MPI

import numpy as np

from perfplast_fenicsx.limit_analysis.body.body_bounds import BodyBounds
from perfplast_fenicsx.limit_analysis.body.limit_forces import limit_forces
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitLoad
from perfplast_fenicsx.problem.judged.resultants import load_resultants
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.rounding import ROUNDING
from perfplast_fenicsx.units import Units


class ResultantTables:
    """Tables of the forces of loads and supports."""

    def __init__(self, units: Units, whole: bool) -> None:
        """Store the units.

        Args:
            units: Units of the case; without a system, moments have the unit force × length of the
                case.
            whole: See :meth:`units.Units.table`.
        """
        self._scale = units.moment_scale(whole)

    def loads(self, problem: Problem) -> list[dict[str, Any]]:
        """Return a table for each load at ζ = 1. Collective."""
        found, rounding = load_resultants(problem), self._rounding(problem)
        return [
            asdict(load) | {"moment": self._told(load.moment, rounding * _largest([load.force]))}
            for load in found
        ]

    def at_limit(
        self, problem: Problem, limit: LimitLoad, body: BodyBounds | None
    ) -> dict[str, Any] | None:
        """Return the table of loads and supports at the limit. Collective."""
        found = limit_forces(problem, limit, body)
        if found is None:
            return None
        least = self._rounding(problem) * _largest(found.reactions.values())
        moments = {name: self._told(moment, least) for name, moment in found.moments.items()}
        return asdict(found) | {"moments": moments}

    def _rounding(self, problem: Problem) -> float:
        """Return the moment of a unit force that counts as zero. Collective."""
        mine = float(np.abs(problem.tagged_mesh.mesh.geometry.x).max(initial=0.0))
        return ROUNDING * problem.comm.allreduce(mine, MPI.MAX)

    def _told(self, moment: Sequence[float], least: float) -> list[float]:
        return [self._scale * number if abs(number) > least else 0.0 for number in moment]


def _largest(forces: Iterable[Sequence[float]]) -> float:
    return max((abs(number) for force in forces for number in force), default=0.0)
