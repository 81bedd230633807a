"""Draw the multiples of loads that are carried: polygons or polytopes of proof. Single-process."""

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


def save_envelope(
    rows: Sequence[Mapping[str, Any]],
    names: Sequence[str],
    title: str,
    path: Path,
    alone: bool = False,
) -> None:
    """Draw the regions that are carried and not carried, with their edges.

    Args:
        rows: Rows of :meth:`~perfplast_fenicsx.limit_analysis.body.interaction.Envelope.rows`.
        names: Names of the two or three loads.
        title: Heading.
        path: The PNG file.
        alone: Whether there are no other loads, so that zero is carried too.

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
    """Return unit vectors of the rows, shape (n, 3)."""
    angle = np.radians([row["angle"] for row in rows])
    rise = np.radians([row.get("elevation", 0.0) for row in rows])
    level = np.cos(rise)
    return np.column_stack([level * np.cos(angle), level * np.sin(angle), np.sin(rise)])


def _ends(rows: Sequence[Mapping[str, Any]], column: str) -> Floats:
    """Return the ends of rays, shape (n, 3); NaN where nothing is known."""
    lengths = [np.nan if row[column] is None else row[column] for row in rows]
    return _rays(rows) * np.array(lengths)[:, None]


def _section(
    rows: Sequence[Mapping[str, Any]], first: int, second: int
) -> Mapping[str, tuple[Floats, bool]]:
    """Return both edges in the plane of two loads by angle, and whether they are closed."""
    rays = _rays(rows)
    inside = np.flatnonzero(np.abs(np.delete(rays, [first, second], axis=1)[:, 0]) < 1e-9)
    turns = np.round(np.arctan2(rays[inside, second], rays[inside, first]), 9)
    turns, order = np.unique(turns, return_index=True)
    around = bool(np.ptp(turns) > 6)  # closed: 2π less a step
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
        ("not carried from", "#d62020", "not carried outside, for certain"),
        ("carried", "#3b6ea5", "carried inside, for certain"),
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
