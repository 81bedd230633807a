"""Draw the loading curve as inline SVG: ζ over α, force over stroke, or factors over works."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from html import escape

from perfplast_fenicsx.pictures.path_points import between, from_rest
from perfplast_fenicsx.pictures.result_reader import FAR, StoredLimit
from perfplast_fenicsx.problem.judged.report import LevelReport
from perfplast_fenicsx.rounding import rounded_down, rounded_up

BOTTOM, EDGE = 46, 14
COLOURS = ("#1f5a99", "#a34700", "#1b6e3c", "#7a3b8f", "#5b5b00", "#9c1c3a")
MARKS = ("circle", "square", "diamond")
DASHES = ("", "8 4", "2 3")
"""Dash patterns of curves. Three curves share each pattern, so curves do not differ by colour
alone."""


@dataclass(frozen=True)
class Sheet:
    """The layout of a drawing; lengths are pixels at full width.

    Attributes:
        name: CSS class of the drawing, by which the page's style sheet selects it.
        width: Total width.
        height: Total height.
        left: Space for the numbers of the y axis.
        most: Largest number of labels along x.
    """

    name: str
    width: int
    height: int
    left: int
    most: int


WIDE, NARROW = Sheet("wide", 640, 360, 72, 7), Sheet("narrow", 358, 300, 62, 4)


@dataclass(frozen=True)
class Line:
    """Points of a curve, and a text for each point."""

    name: str
    x: list[float]
    y: list[float]
    words: list[str]


@dataclass(frozen=True)
class Curve:
    """Curves with their axes and bounds.

    Attributes:
        x_label: Label of the x axis.
        y_label: Label of the y axis.
        lines: The curves.
        band: Bounds of y, shown as a shaded band; None if there are no bounds.
        band_words: Name of these bounds.
        far: Value above which the x axis is logarithmic, in the axis' unit; 0 for a linear axis.
    """

    x_label: str
    y_label: str
    lines: list[Line]
    band: tuple[float, float] | None = None
    band_words: str = ""
    far: float = 0.0


def curve_of(
    reports: Sequence[LevelReport], limit: StoredLimit | None, driven: bool, unit: str
) -> Curve | None:
    """Return the curve of a run; None if no level is solved or no load of a history acts."""
    solved = [a for a in reports if a.converged and math.isfinite(a.alpha)]
    if not solved:
        return None
    words = [f"step {number}" for number in range(1, len(solved) + 1)]
    bracket = f" ({unit})" if unit else ""
    if any(report.factors for report in solved):
        names = [name for name in solved[0].works if any(a.factors[name] for a in solved)]
        lines = [
            Line(
                name,
                [0.0, *(a.works[name] for a in solved)],
                [0.0, *(a.factors[name] for a in solved)],
                ["no load", *words],
            )
            for name in names
        ]
        label = f"work of the load with factor 1{bracket}"
        return Curve(label, "factor of the load", lines) if lines else None
    zetas = [report.zeta for report in solved]
    if driven:
        forces = [report.driving_force for report in solved]
        name = f"driving force (work per unit of ζ, {unit})" if unit else "driving force"
        return Curve("ζ, size of the motion", name, [Line("", zetas, forces, words)])
    alphas = [report.alpha for report in solved]
    x, y = from_rest(solved)
    line = Line("", x, y, words if len(x) == len(words) else ["no load", *words])
    band, band_words = _bounds(limit)
    far = alphas[0] if len(alphas) > 1 and alphas[-1] > FAR * alphas[0] > 0 else 0.0
    label = f"work of the loads α{bracket}{', logarithmic axis' if far else ''}"
    return Curve(label, "load factor ζ", [line], band, band_words, far)


def _bounds(limit: StoredLimit | None) -> tuple[tuple[float, float] | None, str]:
    """Return the bounds for the bodies, or else the sides of the mesh's limit load, and a name."""
    if limit is None:
        return None, ""
    lower, upper = limit.body.get("lower"), limit.body.get("upper")
    if lower is not None and upper is not None:
        return (lower, upper), "limit load of the bodies"
    words = "estimate on this mesh" if limit.theorem else "this path loses equilibrium"
    if limit.upper is None or not math.isfinite(limit.lower):
        return None, words
    return (limit.lower, limit.upper), words


def to_svg(curve: Curve, sheet: Sheet = WIDE) -> str:
    """Return the drawing of a curve as SVG, with an alternative text."""
    left, right, foot = sheet.left, sheet.width - EDGE, sheet.height - BOTTOM
    x_of = _axis(curve.far)
    xs = [x_of(a) for line in curve.lines for a in line.x] + [0.0]
    ys = [a for line in curve.lines for a in line.y] + [0.0, *(curve.band or ())]
    (x_low, x_high), (y_low, y_high) = _range(xs), _range(ys)

    def place(x: float, y: float) -> tuple[float, float]:
        across = (x_of(x) - x_low) / (x_high - x_low)
        up = (y - y_low) / (y_high - y_low)
        return left + across * (right - left), foot - up * (foot - EDGE)

    top = max(max(line.x) for line in curve.lines)
    parts = [_frame(left, right, foot)]
    for x in far_ticks(curve.far, top) if curve.far else ticks(x_low, x_high, sheet.most):
        at, _ = place(x, y_low)
        parts.append(f'<path class="grid" d="M{at:.1f} {EDGE}V{foot}"/>')
        parts.append(f'<text x="{at:.1f}" y="{foot + 16}" class="mid">{x:.6g}</text>')
    for y in ticks(y_low, y_high):
        _, at = place(0.0, y)
        parts.append(f'<path class="grid" d="M{left} {at:.1f}H{right}"/>')
        parts.append(f'<text x="{left - 6}" y="{at + 4:.1f}" class="end">{y:.6g}</text>')
    if curve.band is not None:
        (_, low), (_, high) = (place(0.0, a) for a in curve.band)
        tall = max(low - high, 2.0)
        parts.append(
            f'<rect class="band" x="{left}" y="{high:.1f}" width="{right - left}"'
            f' height="{tall:.1f}"/><text x="{left + 8}" y="{high - 5:.1f}">{curve.band_words}:'
            f" {rounded_down(curve.band[0])} to {rounded_up(curve.band[1])}</text>"
        )
    for number, line in enumerate(curve.lines):
        parts.append(_drawn(line, number, place, left, curved=curve.far > 0))
    parts.append(
        f'<text class="mid" x="{(left + right) / 2}" y="{sheet.height - 8}">'
        f"{escape(curve.x_label)}</text>"
        f'<text class="mid" transform="translate(16 {(foot + EDGE) / 2}) rotate(-90)">'
        f"{escape(curve.y_label)}</text>"
    )
    words = f"{curve.y_label} over {curve.x_label}; the numbers are in the table of levels"
    return (
        f'<svg class="curve {sheet.name}" viewBox="0 0 {sheet.width} {sheet.height}" role="img"'
        f' aria-label="{escape(words)}">{"".join(parts)}</svg>'
    )


def ticks(low: float, high: float, most: int = 7) -> list[float]:
    """Return a few round numbers in a range."""
    rough = (high - low) / most
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(a * power for a in (1, 2, 5, 10) if a * power >= rough)
    first, last = math.ceil(low / step), math.floor(high / step)
    return [number * step for number in range(first, last + 1)]


def far_ticks(near: float, top: float) -> list[float]:
    """Return 0 and powers of ten from about ``near`` to ``top``; more numbers if these are few."""
    first, last = math.ceil(math.log10(near)), math.floor(math.log10(top))
    steps = (1, 2, 5) if last - first < 2 else (1,)
    found = [step * 10.0**power for power in range(first - 1, last + 1) for step in steps]
    return [0.0, *(a for a in found if near <= a * (1 + 1e-9) and a <= top * (1 + 1e-9))]


def _axis(far: float) -> Callable[[float], float]:
    """Return the function of the x axis: linear up to about ``far`` and logarithmic above."""
    return (lambda x: math.asinh(x / far)) if far > 0 else (lambda x: x)


def _range(values: Sequence[float]) -> tuple[float, float]:
    """Return the range of values, with a margin above, and also below if values are negative."""
    low, high = min(values), max(values)
    room = 0.05 * (high - low) or 1.0
    return low - room * (low < 0), high + room


def _frame(left: int, right: int, foot: int) -> str:
    """Return the lines of the left and lower axis."""
    return f'<path class="frame" d="M{left} {EDGE}V{foot}H{right}"/>'


def _drawn(
    line: Line,
    number: int,
    place: Callable[[float, float], tuple[float, float]],
    left: int,
    curved: bool,
) -> str:
    """Return a curve, its entry in the legend, and marks whose texts appear under the pointer."""
    colour, shape = COLOURS[number % len(COLOURS)], MARKS[number % len(MARKS)]
    points = [place(x, y) for x, y in zip(line.x, line.y, strict=True)]
    along = [place(x, y) for x, y in zip(*between(line.x, line.y), strict=True)]
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in (along if curved else points))
    dash = DASHES[number // len(MARKS) % len(DASHES)]
    stroke = f'fill="none" stroke="{colour}" stroke-width="2" stroke-dasharray="{dash}"'
    parts = [f'<polyline points="{path}" {stroke}/>']
    told = zip(points, line.words, line.x, line.y, strict=True)
    for (x, y), words, value_x, value_y in told:
        title = f"<title>{escape(words)}: {value_y:.6g} at {value_x:.6g}</title>"
        parts.append(_mark(shape, x, y, colour, title))
    if line.name:
        at_x, at_y = left + 24, EDGE + 18 + 18 * number
        parts.append(f'<path d="M{at_x - 16} {at_y}h32" {stroke}/>')
        parts.append(_mark(shape, at_x, at_y, colour, ""))
        parts.append(f'<text x="{at_x + 22}" y="{at_y + 4}">{escape(line.name)}</text>')
    return "".join(parts)


def _mark(shape: str, x: float, y: float, colour: str, title: str) -> str:
    if shape == "circle":
        return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4" fill="{colour}">{title}</circle>'
    turned = f' transform="rotate(45 {x:.1f} {y:.1f})"' if shape == "diamond" else ""
    return (
        f'<rect x="{x - 4:.1f}" y="{y - 4:.1f}" width="8" height="8" fill="{colour}"{turned}>'
        f"{title}</rect>"
    )
