"""Draw Bree's diagram: the pairs of varying loads to which bodies shake down. Single-process."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from perfplast_fenicsx.pictures.picture_file import drawable, heading, replace_picture


def save_shakedown(
    rows: Sequence[Mapping[str, Any]], names: Sequence[str], title: str, path: Path
) -> None:
    """Draw the edge of the region of shakedown, and the failures beyond it.

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
