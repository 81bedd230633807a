"""Bound the strength of homogeneous slopes from above, with NumPy and SciPy only.

A block of ground rotates about a pole and separates from the rest along a log spiral (W. F. Chen,
Limit Analysis and Soil Plasticity, 1975, chapter 9). This is a mechanism of associated ground. The
slope collapses at F if the work of the weight is at least the dissipation on the spiral with
strengths divided by F. So each such F is an upper bound, for any pole. Without friction, the spiral
is a slip circle. Integrals are exact: the script does not replace arcs by chords. Only the work of
the pore water, which presses the two sides of the spiral apart, is a sum over the points PRESSED.

The script computes the unit weight at which a slope collapses, and the critical seismic
coefficient, in the same way.

    python3 demos/tribunal/log_spiral.py demos/tribunal/pruska_*.toml
"""

import math
import sys
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import minimize

RANGES = {"strength": (0.05, 20.0), "bounds": (0.5, 200.0), "seismic": (1e-3, 5.0)}
"""Range in which the script searches for factors, by the control of the case."""

ENDS = {"base", "left", "right"}
"""Surfaces that may be held."""

PRESSED = np.linspace(0.0, 1.0, 721)
"""Points at which the pore pressure is evaluated, as fractions of the angle of a spiral."""

TOLERANCE = 1e-5
"""Relative tolerance of the factor for the best pole."""

SAMPLES = np.linspace(0.0, 1.0, 181)
"""Points at which a spiral is compared with the surface, as fractions of its angle."""

TURN = 1.2 * math.pi
"""Largest angle (radians) through which a spiral is followed from its exit."""


@dataclass(frozen=True)
class Slope:
    """Homogeneous ground that descends to the left.

    Attributes:
        x: Abscissas of the corners of the surface, increasing (length).
        y: Heights of the corners of the surface (length).
        bottom: Height of the firm base.
        cohesion: Cohesion (stress).
        friction: Tangent of the friction angle.
        weight: Force per volume, (horizontal, vertical).
        control: Quantity that the script computes: "strength" for a factor of safety, "bounds" for
            a factor of the weight, "seismic" for the critical seismic coefficient.
        push: Direction of the earthquake, 1.0 or -1.0.
        ratio_of_pressure: r_u, the pore pressure divided by the weight of the ground above.
        table: Corners of the water table, shape (points, 2); empty without one.
        water: Unit weight of water (force per volume).
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    bottom: float
    cohesion: float
    friction: float
    weight: tuple[float, float]
    control: str = "strength"
    push: float = -1.0
    ratio_of_pressure: float = 0.0
    table: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 2)))
    water: float = 0.0

    def height(self, x: ArrayLike) -> NDArray[np.float64]:
        """Return the heights of the surface at given abscissas."""
        return np.asarray(np.interp(np.asarray(x), self.x, self.y))

    def pressure(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return pore pressures at points."""
        found = -self.weight[1] * self.ratio_of_pressure * (self.height(x) - y)
        if len(self.table):
            found = found + self.water * np.maximum(np.interp(x, *self.table.T) - y, 0.0)
        return found

    @property
    def wet(self) -> bool:
        """Whether the pores contain water."""
        return bool(len(self.table)) or self.ratio_of_pressure > 0

    def mirrored(self) -> "Slope":
        """Return the mirror image."""
        return replace(
            self,
            x=-self.x[::-1],
            y=self.y[::-1],
            weight=(-self.weight[0], self.weight[1]),
            push=-self.push,
            table=self.table[::-1] * (-1, 1),
        )

    def at(self, value: float) -> tuple["Slope", float]:
        """Return the slope for a value of the unknown quantity, and the divisor of strengths."""
        across, down = self.weight
        if self.control == "strength":
            return self, value
        if self.control == "bounds":
            return replace(self, weight=(value * across, value * down)), 1.0
        return replace(self, weight=(-value * self.push * down, down)), 1.0


def slope_of(case: dict[str, Any]) -> Slope | None:
    """Return the slope of a case file; None if the script does not apply.

    The script applies to a single body that is loaded only by its weight, is held only at its base
    and its ends, and has no water above the surface.

    Args:
        case: The parsed TOML file.
    """
    drawn = [*case.get("stratum", ()), *case.get("region", ())]
    (control,) = {case["loading"]["control"]} & RANGES.keys() or {""}
    held = {support["on"] for support in case.get("support", ())}
    (law,) = list(case["material"].values())[:1]
    cohesion = law.get("cohesion", law.get("yield_stress", 0.0) / math.sqrt(3))
    if len(drawn) != 1 or not control or held - ENDS or isinstance(cohesion, str):
        return None
    (body,) = drawn
    surface, weight = _surface(body), _weight(case, control, body["name"])
    if surface is None or weight is None:
        return None
    points, bottom = surface
    water = case.get("water", {})
    table = np.array(water.get("table", np.empty((0, 2))), float)
    density = case.get("gravity", {}).get("density", {}).get(body["name"])
    if {"piezometric", "dry", "on"} & water.keys() or "seepage" in case:
        return None
    if any(value != density for value in water.get("saturated", {}).values()):
        return None
    push = float(case.get("earthquake", {}).get("direction", (-1.0, 0.0))[0])
    x, y = points.T
    both = np.union1d(x, table[:, 0])
    if len(table) and (np.interp(both, *table.T) > np.interp(both, x, y) + 1e-9).any():
        return None
    slope = Slope(
        x,
        y,
        float(bottom),
        float(cohesion),
        math.tan(math.radians(law.get("friction_angle", 0.0))),
        weight,
        control,
        push,
        float(water.get("ru", {}).get(body["name"], 0.0)),
        table,
        float(water.get("unit_weight", 9.81)),
    )
    return slope.mirrored() if y[0] > y[-1] else slope


def _surface(body: dict[str, Any]) -> tuple[NDArray[np.float64], float] | None:
    """Return the corners of the surface of a drawn body, and the level of its base, or None.

    A vertical part of the surface gets an inclination of a billionth.
    """
    if "top" in body:
        points, bottom = np.array(body["top"], float), body["bottom"]
        if not isinstance(bottom, int | float):
            return None
    else:
        ring = np.array(body["points"], float)
        bottom = ring[:, 1].min()
        first, last = (np.lexsort((-ring[:, 1], side * ring[:, 0]))[0] for side in (1, -1))
        count = len(ring)
        ways = [ring[(first + step * np.arange(count)) % count] for step in (1, -1)]
        lengths = [(step * (last - first)) % count + 1 for step in (1, -1)]
        over = [way[:length] for way, length in zip(ways, lengths, strict=True)]
        over = [way for way in over if (way[1:, 1] > bottom).all()]
        if len(over) != 1 or np.count_nonzero(ring[:, 1] == bottom) != 2:
            return None
        (points,) = over
    steps = np.diff(points[:, 0])
    if (steps < 0).any():
        return None
    points[1:, 0] += 1e-9 * np.ptp(points[:, 0]) * np.cumsum(steps == 0)
    return points, float(bottom)


def _weight(case: dict[str, Any], control: str, name: str) -> tuple[float, float] | None:
    """Return the force per volume of a body; None if other loads act."""
    loads = case.get("load", ())
    if control == "bounds":
        if len(loads) != 1 or set(loads[0]) != {"on", "body_force"} or loads[0]["on"] != name:
            return None
        across, down = loads[0]["body_force"]
        return float(across), float(down)
    if loads or "gravity" not in case:
        return None
    density = case["gravity"]["density"][name]
    across, down = (density * part for part in case["gravity"]["acceleration"])
    return across, down


def ratio(mechanism: Sequence[float], slope: Slope, factor: float) -> float:
    """Return dissipation divided by work of the weight, with strengths divided by a factor.

    Args:
        mechanism: Abscissa and height of the pole, and abscissa of the exit on the surface.
        slope: The ground.
        factor: F.

    Returns:
        The ratio; infinite if the mechanism is not possible.
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
        """Return points of the spiral, whose radius decreases with the angle from the exit."""
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
    if slope.wet:
        along = end * PRESSED
        pressed = np.maximum(slope.pressure(*arc(along)), 0.0)
        work += t * float(np.trapezoid(pressed * (radius * np.exp(-t * along)) ** 2, along))
    if work <= 0:
        return math.inf
    swept = radius**2 * (-math.expm1(-2 * t * end) / (2 * t) if t > 0 else end)
    return slope.cohesion / factor * swept / work


def _root(above: Any, low: float, high: float) -> float:
    """Return the parameter at which the spiral leaves the ground, rounded down."""
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

    The block rotates clockwise, so its velocity is (y, -x) relative to the pole. Moments of the
    area of the block are integrals over sectors with a corner at the pole: ∫ r³ (cos θ, sin θ) dθ /
    3.
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
    """Return the least ratio that a search from given mechanisms finds, and its mechanism."""
    best: tuple[float, Any] = (math.inf, None)
    for start in starts:
        value = ratio(start, slope, factor)
        if math.isfinite(value):
            options = {"xatol": 1e-5, "fatol": 1e-9, "maxiter": 600}
            found = minimize(ratio, start, (slope, factor), method="Nelder-Mead", options=options)
            best = min(best, (float(found.fun), found.x), key=lambda pair: pair[0])
    return best


def upper_bound(slope: Slope) -> float | None:
    """Return the least factor at which a log spiral collapses; None if no spiral does.

    A dam may collapse to either side; its ends have the same level.
    """
    ways = [slope, slope.mirrored()] if slope.y[0] == slope.y[-1] else [slope]
    found = [bound for way in ways if (bound := _upper_bound(way)) is not None]
    return min(found, default=None)


def _upper_bound(slope: Slope) -> float | None:
    """Return the least factor at which a log spiral collapses to the left, or None.

    The factor is rounded up, and the work of the mechanism is checked at the rounded factor.
    """
    low, high = RANGES[slope.control]
    largest = high
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
        value = math.sqrt(low * high)
        loaded, factor = slope.at(value)
        best = least(loaded, factor, last)
        if best[0] > 1 and high > 1.05 * low:
            rank = partial(ratio, slope=loaded, factor=factor)
            ranked = sorted(grid, key=rank)[:3]
            best = min(best, least(loaded, factor, ranked), key=lambda pair: pair[0])
        if best[1] is not None:
            last = [best[1]]
        low, high = (low, value) if best[0] < 1 - 1e-9 else (value, high)
    return None if high == largest else math.ceil(high * 1e5) / 1e5


def main(paths: Sequence[str]) -> None:
    """Print the upper bound of each case file."""
    for path in map(Path, paths):
        slope = slope_of(tomllib.loads(path.read_text(encoding="utf-8")))
        bound = None if slope is None else upper_bound(slope)
        print(path.stem, "no log spiral" if bound is None else f"at most {bound:.5f}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
