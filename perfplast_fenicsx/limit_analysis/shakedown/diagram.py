"""Compute shakedown loads for all ratios of two varying loads: a Bree diagram of any bodies.

J. Bree, Elastic-plastic behaviour of thin tubes subjected to internal pressure and intermittent
high-heat fluxes, Journal of Strain Analysis 2 (1967), 226, has the diagram of a tube under
pressure. Its wall is heated repeatedly.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.limit_analysis.conic.interior_steps import InteriorStep
from perfplast_fenicsx.limit_analysis.shakedown.elastic_stresses import LoadDomain
from perfplast_fenicsx.limit_analysis.shakedown.shakedown_load import shakedown_load
from perfplast_fenicsx.problem.problem import Problem


@dataclass(frozen=True)
class Direction:
    """The shakedown load for one ratio of two varying loads.

    Attributes:
        angle: Arc tangent of the ratio (degrees), in units of the shakedown loads of each alone: 0
            if only the first load varies.
        first: Factor of the first load at the end of shakedown; None if none was found.
        second: Factor of the second load.
        failure: Kind of failure beyond it.
    """

    angle: float
    first: float | None
    second: float | None
    failure: str


def check_directions(domain: LoadDomain, directions: int) -> None:
    """Check that the domain has two loads for a diagram.

    Raises:
        InputError: If it has not, or if there are too few directions.
    """
    if directions and (directions < 3 or len(domain.names) != 2):
        raise InputError(
            f"directions = {directions} with {len(domain.names)} varying names; give 3 or more"
            " with two names, or leave it out."
        )


def shakedown_diagram(
    problem: Problem,
    domain: LoadDomain,
    directions: int = 13,
    rtol: float = 1e-4,
    monitor: Callable[[Direction], None] | None = None,
    steps: Callable[[InteriorStep], None] | None = None,
) -> list[Direction]:
    """Return the shakedown loads for evenly spaced ratios of two varying loads. Collective.

    Args:
        problem: The bodies.
        domain: Domain with two names; the factors of each are multiplied.
        directions: Number of directions over a quarter of the circle.
        rtol: As for :func:`shakedown_load`.
        monitor: Called on every rank after each direction.
        steps: Called on every rank after each step of the interior point method.

    Raises:
        InputError: As :func:`shakedown_load`, and if there are not two names.
    """
    check_directions(domain, directions)
    told = (problem, domain, rtol, steps)
    ends = [_at(angle, axis, *told) for angle, axis in ((0.0, (1.0, 0.0)), (90.0, (0.0, 1.0)))]
    one, other = ends[0].first or 1.0, ends[1].second or 1.0
    found = []
    for number, angle in enumerate(np.linspace(0.0, 90.0, directions)):
        between = 0 < number < directions - 1
        ray = (one * math.cos(math.radians(angle)), other * math.sin(math.radians(angle)))
        found.append(_at(float(angle), ray, *told) if between else ends[number > 0])
        if monitor is not None:
            monitor(found[-1])
    return found


def _at(
    angle: float,
    ray: tuple[float, float],
    problem: Problem,
    domain: LoadDomain,
    rtol: float,
    steps: Callable[[InteriorStep], None] | None,
) -> Direction:
    """Return the shakedown load along a ray. Collective."""
    along = replace(domain, corners=domain.corners * np.array(ray))
    found = shakedown_load(problem, along, rtol, steps)
    first, second = None, None
    if found.converged and found.load is not None:
        first, second = (found.load * part for part in ray)
    return Direction(angle, first, second, str(found.failure))
