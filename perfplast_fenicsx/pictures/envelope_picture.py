"""Draw multiples of loads: interaction diagrams, Bree diagrams, and curves over the strength.

A curve over the strength shows the carried multiple of the constant loads over the factor that
divides all strengths. If there is a path, the factor over the work of the loads is drawn next to
it. Single-process.
"""

from collections.abc import Mapping, Sequence
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.pictures.picture_file import drawable, heading, replace_picture
from perfplast_fenicsx.rounding import rounded_down, rounded_up


def save_envelope(
    rows: Sequence[Mapping[str, Any]],
    names: Sequence[str],
    title: str,
    path: Path,
    alone: bool = False,
) -> None:
    """Draw the load multiples that are certainly carried, and those that are certainly not carried.

    Args:
        rows: Rows of :meth:`~perfplast_fenicsx.limit_analysis.body.interaction.Envelope.rows`.
        names: Names of the two or three loads.
        title: Heading.
        path: The PNG file.
        alone: Whether there are no other loads, in which case zero loads are carried too.

    Raises:
        OSError: If the file cannot be written.
    """
    space = len(names) == 3
    figure = Figure(figsize=(10, 10) if space else (6, 6), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    if space:
        _surfaces(figure.add_subplot(2, 2, 1, projection="3d"), rows, names)
        for place, (first, second) in enumerate(combinations(range(3), 2), 2):
            section = _section(rows, first, second)
            _polygons(figure.add_subplot(2, 2, place), section, names[first], names[second], alone)
        figure.suptitle(heading(title), parse_math=False)
    else:
        axes = figure.add_subplot()
        _polygons(axes, _section(rows, 0, 1), names[0], names[1], alone)
        axes.set_title(heading(title), parse_math=False)
    replace_picture(path, figure)


def _rays(rows: Sequence[Mapping[str, Any]]) -> Floats:
    """Return a unit vector in the direction of each row, shape (n, 3)."""
    angle = np.radians([row["angle"] for row in rows])
    rise = np.radians([row.get("elevation", 0.0) for row in rows])
    level = np.cos(rise)
    return np.column_stack([level * np.cos(angle), level * np.sin(angle), np.sin(rise)])


def _ends(rows: Sequence[Mapping[str, Any]], column: str) -> Floats:
    """Return the end points of rays, shape (n, 3); NaN where no value is known."""
    lengths = [np.nan if row[column] is None else row[column] for row in rows]
    return _rays(rows) * np.array(lengths)[:, None]


def _section(
    rows: Sequence[Mapping[str, Any]], first: int, second: int
) -> Mapping[str, tuple[Floats, bool]]:
    """Return both boundaries in the plane of two loads, sorted by angle, and whether they close."""
    rays = _rays(rows)
    inside = np.flatnonzero(np.abs(np.delete(rays, [first, second], axis=1)[:, 0]) < 1e-9)
    turns = np.round(np.arctan2(rays[inside, second], rays[inside, first]), 9)
    turns, order = np.unique(turns, return_index=True)
    around = bool(np.ptp(turns) > 6)  # closed: from 0 to 2π minus a step
    found = {}
    for column in ("not carried from", "carried"):
        points = _ends(rows, column)[inside[order]][:, [first, second]]
        found[column] = np.vstack([points, points[:1]]) if around else points, around
    return found


def _polygons(
    axes: Axes,
    edges: Mapping[str, tuple[Floats, bool]],
    first: str,
    second: str,
    alone: bool,
) -> None:
    for column, colour, says in (
        ("not carried from", "#d62020", "certainly not carried outside"),
        ("carried", "#3b6ea5", "certainly carried inside"),
    ):
        points, around = edges[column]
        points = points[np.isfinite(points).all(axis=1)]
        axes.plot(*points.T, color=colour, label=says)
        if column == "carried":
            corner = np.zeros((1, 2)) if alone and not around else np.zeros((0, 2))
            axes.fill(*np.vstack([corner, points]).T, color=colour, alpha=0.15)
    axes.axhline(0.0, color="black", linewidth=0.6)
    axes.axvline(0.0, color="black", linewidth=0.6)
    axes.set_xlabel(drawable(first), parse_math=False)
    axes.set_ylabel(drawable(second), parse_math=False)
    axes.grid(alpha=0.3)
    axes.legend(loc="best")


def _surfaces(axes: Any, rows: Sequence[Mapping[str, Any]], names: Sequence[str]) -> None:
    """Draw both surfaces over the grid of rays: the inner one filled, the outer one as lines."""
    turns = len({row["angle"] for row in rows})
    for column, style in (
        ("carried", {"color": "#3b6ea5", "alpha": 0.6, "linewidth": 0}),
        ("not carried from", {"color": "#d62020", "linewidth": 0.4, "rstride": 1, "cstride": 1}),
    ):
        grid = _ends(rows, column).reshape(turns, -1, 3)
        draw = axes.plot_surface if column == "carried" else axes.plot_wireframe
        draw(*np.moveaxis(grid, -1, 0), **style)
    for axis, name in zip("xyz", names, strict=True):
        getattr(axes, f"set_{axis}label")(drawable(name), parse_math=False)


def save_shakedown(
    rows: Sequence[Mapping[str, Any]], names: Sequence[str], title: str, path: Path
) -> None:
    """Draw the boundary of the shakedown region, and the failures beyond it.

    Args:
        rows: Rows of :class:`~perfplast_fenicsx.limit_analysis.shakedown.shakedown_load.Direction`.
        names: Names of the two varying loads.
        title: Heading.
        path: The PNG file.

    Raises:
        OSError: If the file cannot be written.
    """
    marks = {"alternating plasticity": ("^", "#d62020"), "incremental collapse": ("s", "#3b6ea5")}
    figure = Figure(figsize=(6, 6), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    known = [row for row in rows if row["first"] is not None]
    x, y = [row["first"] for row in known], [row["second"] for row in known]
    axes.fill([0.0, *x], [0.0, *y], color="#3b6ea5", alpha=0.12)
    axes.plot(x, y, color="#555555", linewidth=1.0)
    for failure in dict.fromkeys(row["failure"] for row in known):
        marker, colour = marks.get(failure, ("D", "#7a3fa0"))
        some = [(a, b) for a, b, row in zip(x, y, known, strict=True) if row["failure"] == failure]
        points = zip(*some, strict=True)
        axes.plot(*points, marker, color=colour, label=f"beyond: {failure}", clip_on=False)
    axes.set_xlim(left=0.0)
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel(drawable(f"times {names[0]}"), parse_math=False)
    axes.set_ylabel(drawable(f"times {names[1]}"), parse_math=False)
    axes.set_title(heading(f"{title}: shakedown (estimate)"), parse_math=False)
    axes.grid(alpha=0.3)
    axes.legend(loc="best")
    replace_picture(path, figure)


SIDES = {
    "lower": ("#3b6ea5", "carried for certain", "stands with F = "),
    "upper": ("#d62020", "carried at most", "falls at F = "),
}
"""Colour, label of the bound on the loads, and label of the factor of safety from this bound."""


def save_strength(table: Mapping[str, Any], title: str, path: Path) -> None:
    """Draw both bounds on the load multiple over F, both bounds on F, and the mesh's curve.

    Args:
        table: Table of :meth:`safety_factor.FactorOfSafety.table`; if it is an estimate, the legend
            says so.
        title: Heading.
        path: The PNG file.

    Raises:
        OSError: If the file cannot be written.
    """
    path_of_mesh = table.get("path") or {}
    points = path_of_mesh.get("points", [])
    figure = Figure(figsize=(13 if points else 7, 5), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot(1, 1 + bool(points), 1)
    if points:
        _over_work(figure.add_subplot(1, 2, 2), points, table)
    estimate = bool(table.get("estimate"))
    for side, (colour, carried, proves) in SIDES.items():
        says = (
            f"{carried.removesuffix(' for certain')} (estimate by Davis)" if estimate else carried
        )
        known = [(row["factor"], row[side]) for row in table["curve"] if row[side] is not None]
        if known:
            axes.plot(*zip(*known, strict=True), "o-", color=colour, markersize=4, label=says)
        if (factor := table[side]) is not None:
            shown = (rounded_down if side == "lower" else rounded_up)(factor)
            label = f"{proves}{shown}"
            axes.axvline(factor, color=colour, linestyle="--", linewidth=1.0, label=label)
    axes.axhline(1.0, color="black", linewidth=0.8)
    axes.set(xlabel="divisor F of the strengths", ylabel="carried multiple of the loads")
    axes.set_title(heading(title), parse_math=False)
    axes.grid(alpha=0.3)
    axes.legend(loc="best")
    replace_picture(path, figure)


def _over_work(axes: Axes, points: Sequence[Mapping[str, Any]], table: Mapping[str, Any]) -> None:
    """Draw the factor on the mesh over the work of the loads, and the proven factors."""
    work, factor = ([point[key] for point in points] for key in ("work", "factor"))
    axes.plot(work, factor, "o-", color="black", markersize=4, label="mesh: an estimate")
    for side, (colour, _, proves) in SIDES.items():
        if table[side] is not None:
            label = proves.removesuffix(" with F = ").removesuffix(" at F = ")
            axes.axhline(table[side], color=colour, linestyle="--", linewidth=1.0, label=label)
    axes.set_xscale("log")
    axes.set(xlabel="work of the loads", ylabel="divisor F of the strengths")
    axes.grid(alpha=0.3)
    axes.legend(loc="lower right")
