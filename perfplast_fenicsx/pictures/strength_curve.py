"""Draw the multiple of constant loads that is carried, over the factor that divides all strengths.

If there is a path, the factor over the work of the loads is drawn beside it. Single-process.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from perfplast_fenicsx.pictures.picture_file import heading, replace_picture
from perfplast_fenicsx.rounding import rounded_down, rounded_up

SIDES = {
    "lower": ("#3b6ea5", "carried for certain", "stands with F = "),
    "upper": ("#d62020", "carried at most", "falls at F = "),
}
"""Colour, label of a bound of the loads, and label of the factor that follows from it."""


def save_strength(table: Mapping[str, Any], title: str, path: Path) -> None:
    """Draw both strict bounds over the factor, with the two factors at which they are 1.

    Args:
        table: Table of :meth:`safety_factor.FactorOfSafety.table`; the legend marks an estimate.
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
    axes.set(xlabel="F, by which strengths are divided", ylabel="times that the loads are carried")
    axes.set_title(heading(title), parse_math=False)
    axes.grid(alpha=0.3)
    axes.legend(loc="best")
    replace_picture(path, figure)


def _over_work(axes: Axes, points: Sequence[Mapping[str, Any]], table: Mapping[str, Any]) -> None:
    """Draw the curve of the mesh, together with the factors that are proven."""
    work, factor = ([point[key] for point in points] for key in ("work", "factor"))
    axes.plot(work, factor, "o-", color="black", markersize=4, label="mesh: an estimate")
    for side, (colour, _, proves) in SIDES.items():
        if table[side] is not None:
            label = proves.removesuffix(" with F = ").removesuffix(" at F = ")
            axes.axhline(table[side], color=colour, linestyle="--", linewidth=1.0, label=label)
    axes.set_xscale("log")
    axes.set(xlabel="work of the loads", ylabel="F, by which strengths are divided")
    axes.grid(alpha=0.3)
    axes.legend(loc="lower right")
