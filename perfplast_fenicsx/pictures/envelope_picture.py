"""Which pairs of two loads are carried: the two polygons of proof. Single-process."""

from collections.abc import Mapping, Sequence
from math import cos, radians, sin
from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from perfplast_fenicsx.pictures.heading import heading
from perfplast_fenicsx.pictures.picture_file import replace_picture


def save_envelope(
    rows: Sequence[Mapping[str, Any]],
    names: tuple[str, str],
    title: str,
    path: Path,
    alone: bool = False,
) -> None:
    """Draw both polygons, and between them where the edge of what is carried runs.

    Args:
        rows: Of :meth:`~perfplast_fenicsx.limit_analysis.body.interaction.Envelope.table`.
        names: Of the two loads.
        title: Heading.
        path: The png file.
        alone: Whether no load acts beside the pairs, so that (0, 0) is carried too.

    Raises:
        OSError: If the file cannot be written.
    """
    figure = Figure(figsize=(6, 6), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    for column, colour, says in (
        ("not carried from", "#d62020", "not carried outside, for certain"),
        ("carried", "#3b6ea5", "carried inside, for certain"),
    ):
        known = [(radians(row["angle"]), row[column]) for row in rows if row[column] is not None]
        x, y = [r * cos(angle) for angle, r in known], [r * sin(angle) for angle, r in known]
        axes.plot(x, y, color=colour, label=says)
        if column == "carried":
            corner = [0.0] if alone and rows[-1]["angle"] < 360 else []
            axes.fill(corner + x, corner + y, color=colour, alpha=0.15)
    axes.axhline(0.0, color="black", linewidth=0.6)
    axes.axvline(0.0, color="black", linewidth=0.6)
    axes.set_xlabel(names[0], parse_math=False)
    axes.set_ylabel(names[1], parse_math=False)
    axes.set_title(heading(title), parse_math=False)
    axes.grid(alpha=0.3)
    axes.legend(loc="best")
    replace_picture(path, figure)
