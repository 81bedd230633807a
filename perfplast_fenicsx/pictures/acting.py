"""Determine the factors of loads, and the motion of obstacles, in a picture's state."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.contact.declared.obstacles import Obstacle
from perfplast_fenicsx.problem.declared.loads import Load
from perfplast_fenicsx.problem.judged.state import LevelReport


@dataclass(frozen=True)
class Acting:
    """Factors of loads and motions.

    Attributes:
        zeta: Load factor.
        factors: Factors of stages by name; empty without stages.
    """

    zeta: float = 0.0
    factors: Mapping[str, float] = field(default_factory=dict)

    def of_load(self, load: Load) -> float:
        """Return the factor of a load; without stages it is 1, or −1 if ζ is negative."""
        if load.constant:
            return 1.0
        if self.factors:
            return self.factors.get(load.name or load.on, 1.0)
        return -1.0 if self.zeta < 0 else 1.0

    def of_obstacle(self, obstacle: Obstacle) -> float:
        """Return the share of its ``move`` that an obstacle has made."""
        if not self.factors:
            return self.zeta
        return self.factors.get(obstacle.name or obstacle.on, 0.0)


def acting(reports: Sequence[LevelReport | None]) -> list[Acting]:
    """Return the factors of levels, and of the unloaded bodies for None."""
    names = next((report.factors for report in reports if report), {})
    at_rest = Acting(factors=dict.fromkeys(names, 0.0))
    return [Acting(report.zeta, report.factors) if report else at_rest for report in reports]


def shares(states: Sequence[Acting], loads: Sequence[Load]) -> Floats:
    """Return the factors of loads relative to the largest one of each.

    Shape (num_states, num_loads).
    """
    found: Floats = np.array([[state.of_load(load) for load in loads] for state in states])
    largest: Floats = np.abs(found).max(axis=0)
    return np.asarray(found / np.where(largest > 0, largest, 1.0), dtype=np.float64)
