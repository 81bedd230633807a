"""Bound factors of safety of homogeneous dry slopes from above, by NumPy and SciPy alone.

A block of ground rotates about a pole and leaves the rest along a log spiral (W. F. Chen, Limit
Analysis and Soil Plasticity, 1975, chapter 9). That is a mechanism of associated ground. If the
weight does at least the work that the spiral dissipates with strengths divided by F, the slope
falls at F. So each such F is an upper bound, however well the pole is chosen. Integrals are exact:
no arc is replaced by chords.

    python3 demos/tribunal/log_spiral.py demos/tribunal/pruska_*.toml
"""

import math
import sys
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import minimize

FACTORS = (0.05, 20.0)
"""Where factors are sought."""

TOLERANCE = 1e-5
"""Relative, of a factor for the best pole that was found."""

SAMPLES = np.linspace(0.0, 1.0, 181)
"""Where a spiral is compared with the surface, as shares of its angle."""

TURN = 1.2 * math.pi
"""Largest angle (radians) through which a spiral is followed from its exit."""


@dataclass(frozen=True)
class Slope:
    """Homogeneous dry ground that descends to the left.

    Attributes:
        x: Abscissas of the surface's corners, increasing (length).
        y: Their heights.
        bottom: Height of the firm base.
        cohesion: (stress).
        friction: Tangent of the angle of friction.
        weight: Force per volume, (horizontal, vertical).
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    bottom: float
    cohesion: float
    friction: float
    weight: tuple[float, float]

    def height(self, x: ArrayLike) -> NDArray[np.float64]:
        """Return heights of the surface."""
        return np.asarray(np.interp(np.asarray(x), self.x, self.y))


def slope_of(case: dict[str, Any]) -> Slope | None:
    """Return the slope of a case file; None if it is not homogeneous, dry and free of loads.

    Args:
        case: The parsed TOML file.
    """
    drawn = [*case.get("stratum", ()), *case.get("region", ())]
    if len(drawn) != 1 or {"water", "seepage", "load"} & case.keys():
        return None
    (body,) = drawn
    if "top" in body:
        points, bottom = np.array(body["top"], float), body["bottom"]
        if not isinstance(bottom, int | float):
            return None
    else:
        points = np.array(body["points"], float)
        bottom = points[:, 1].min()
        base = np.flatnonzero(points[:, 1] == bottom)
        points = points[np.argsort(points[:, 0], kind="stable")]
        if len(base) != 2 or not points[0, 1] == bottom:
            return None
        right = points[points[:, 0] == points[-1, 0]]
        points = np.vstack([points[points[:, 0] < points[-1, 0]], right[[right[:, 1].argmax()]]])
    (law,) = case["material"].values()
    (density,) = case["gravity"]["density"].values()
    across, down = (density * part for part in case["gravity"]["acceleration"])
    if points[0, 1] > points[-1, 1]:  # the mirror image
        points, across = points[::-1] * (-1, 1), -across
    friction = math.tan(math.radians(law.get("friction_angle", 0.0)))
    x, y = points.T
    return Slope(x, y, float(bottom), law["cohesion"], friction, (across, down))


def ratio(mechanism: Sequence[float], slope: Slope, factor: float) -> float:
    """Return the dissipated work over that of the weight, with strengths divided by a factor.

    Args:
        mechanism: Abscissa and height of the pole, and abscissa of the exit on the surface.
        slope: The ground.
        factor: F.

    Returns:
        The ratio; infinite where the mechanism is not possible.
    """
    pole = np.array(mechanism[:2])
    if not slope.x[0] <= mechanism[2] < slope.x[-1]:
        return math.inf
    start = np.array([mechanism[2], slope.height(mechanism[2])]) - pole
    if start[1] >= 0:
        return math.inf
    angle, radius, t = math.atan2(start[1], start[0]), math.hypot(*start), slope.friction / factor
    turned = TURN * SAMPLES

    def arc(turned: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return points of the spiral, whose radius falls with the angle from the exit."""
        r = radius * np.exp(-t * turned)
        return pole[0] + r * np.cos(angle + turned), pole[1] + r * np.sin(angle + turned)

    def above(turned: NDArray[np.float64]) -> NDArray[np.float64]:
        x, y = arc(turned)
        return y - slope.height(x)

    out = np.flatnonzero(above(turned[1:]) > 0)
    if not len(out) or out[0] < 3:
        return math.inf
    end = _root(above, turned[out[0]], turned[out[0] + 1])
    x, y = arc(end * SAMPLES)
    inside = slope.x[0] <= x.min() and x.max() <= slope.x[-1] and slope.bottom <= y.min()
    if not inside or (above(end * SAMPLES[1:-1]) > 0).any():
        return math.inf
    work = float(np.dot(slope.weight, _velocity(slope, pole, (angle, radius, t), end, x[[0, -1]])))
    if work <= 0:
        return math.inf
    swept = radius**2 * (-math.expm1(-2 * t * end) / (2 * t) if t > 0 else end)
    return slope.cohesion / factor * swept / work


def _root(above: Any, low: float, high: float) -> float:
    """Return where the spiral comes out of the ground, to rounding, from below."""
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (low, middle) if above(np.array(middle)) > 0 else (middle, high)
    return low


def _velocity(
    slope: Slope,
    pole: NDArray[np.float64],
    spiral: tuple[float, float, float],
    end: float,
    ends: NDArray[np.float64],
) -> tuple[float, float]:
    """Return the integral of the velocity over the block, for a unit angular velocity.

    The block turns clockwise, so that its velocity is (y, -x) from the pole. Moments of its area
    are integrals over sectors that have the pole as their corner: ∫ r³ (cos θ, sin θ) dθ / 3.
    """
    angle, radius, t = spiral
    a = -3.0 * t

    def primitive(theta: float) -> NDArray[np.float64]:
        """Return an integral of exp(a (θ - angle)) (cos θ, sin θ)."""
        cos, sin = math.cos(theta), math.sin(theta)
        grown = math.exp(a * (theta - angle)) / (1 + a * a)
        return np.array([grown * (a * cos + sin), grown * (a * sin - cos)])

    moment = radius**3 / 3 * (primitive(angle + end) - primitive(angle))
    between = (slope.x > ends[0]) & (slope.x < ends[1])
    x = np.concatenate([ends[:1], slope.x[between], ends[1:]])
    corners = np.column_stack([x, slope.height(x)]) - pole
    first, second = corners[1:], corners[:-1]  # the surface, back to the exit
    cross = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    moment = moment + cross @ (first + second) / 6
    return float(moment[1]), float(-moment[0])


def least(slope: Slope, factor: float, starts: Sequence[Sequence[float]]) -> tuple[float, Any]:
    """Return the least ratio that is found from some mechanisms, and its mechanism."""
    best: tuple[float, Any] = (math.inf, None)
    for start in starts:
        value = ratio(start, slope, factor)
        if math.isfinite(value):
            options = {"xatol": 1e-5, "fatol": 1e-9, "maxiter": 600}
            found = minimize(ratio, start, (slope, factor), method="Nelder-Mead", options=options)
            best = min(best, (float(found.fun), found.x), key=lambda pair: pair[0])
    return best


def upper_bound(slope: Slope) -> float | None:
    """Return the least factor at which a log spiral falls; None if none of them does.

    The factor is rounded up, and the work of its mechanism is checked at it.
    """
    low, high = FACTORS
    span, rise = slope.x[-1] - slope.x[0], float(np.ptp(slope.y))
    top, foot = slope.y[-1], float(slope.x[np.flatnonzero(slope.y > slope.y[0])[0] - 1])
    grid = [
        (x, top + up * rise, foot + out * rise)
        for x in foot + span * np.linspace(-0.2, 0.6, 9)
        for up in (-0.3, 0.0, 0.4, 0.9, 1.6, 2.5, 4.0)
        for out in (-0.8, -0.3, 0.0, 0.2, 0.5)
    ]
    last: list[Any] = []
    while high > (1 + TOLERANCE) * low:
        factor = math.sqrt(low * high)
        best = least(slope, factor, last)
        if best[0] > 1 and high > 1.05 * low:
            ranked = sorted(grid, key=lambda start: ratio(start, slope, factor))[:3]
            best = min(best, least(slope, factor, ranked), key=lambda pair: pair[0])
        if best[1] is not None:
            last = [best[1]]
        low, high = (low, factor) if best[0] < 1 - 1e-9 else (factor, high)
    return None if high == FACTORS[1] else math.ceil(high * 1e5) / 1e5


def main(paths: Sequence[str]) -> None:
    """Print the bound of each case file."""
    for path in map(Path, paths):
        slope = slope_of(tomllib.loads(path.read_text(encoding="utf-8")))
        bound = None if slope is None else upper_bound(slope)
        print(path.stem, "no log spiral" if bound is None else f"F ≤ {bound:.5f}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
