"""Compute the points of a loading curve: its start, its levels, and points between levels."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.problem.judged.report import LevelReport
from perfplast_fenicsx.rounding import ROUNDING


def from_rest(solved: Sequence[LevelReport]) -> tuple[list[float], list[float]]:
    """Return the works α and load factors ζ at the start of the curve and at the levels.

    The curve starts at the unloaded bodies, unless the first level has only constant loads (ζ = 0).
    Then the curve starts at this level, where these loads have already done work.
    """
    alphas, zetas = [a.alpha for a in solved], [a.zeta for a in solved]
    if zetas and abs(zetas[0]) <= ROUNDING * max(map(abs, zetas)):
        return alphas, zetas
    return [0.0, *alphas], [0.0, *zetas]


def between(x: Sequence[float], y: Sequence[float]) -> tuple[list[float], list[float]]:
    """Return the curve with more points on each segment, which a logarithmic x axis bends."""
    xs, ys = list(x[:1]), list(y[:1])
    many = 24  # number of points on each segment
    for (a, b), (low, high) in zip(pairwise(x), pairwise(y), strict=True):
        t: Floats = np.arange(1, many + 1) / many
        if a > 0 and b > 0 and a != b:
            t = np.asarray((np.geomspace(a, b, many + 1)[1:] - a) / (b - a), dtype=np.float64)
        xs += [a + share * (b - a) for share in t]
        ys += [low + share * (high - low) for share in t]
    return xs, ys
