"""Draw the results of a sweep over the first varied key. Single-process."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from perfplast_fenicsx.pictures.picture_file import heading, in_legend, replace_picture

LINES = {
    "lower": ("^-", "lower bound, proven"),
    "estimate": (".:", "estimate of the mesh"),
    "upper": ("v-", "upper bound, proven"),
    "zeta": ("o-", "last solved level"),
}
"""Columns that are drawn, with their markers and labels."""


def save_sweep(
    rows: Sequence[Mapping[str, Any]], keys: Sequence[str], title: str, path: Path
) -> bool:
    """Draw the results over the first key, with a line for each combination of other values.

    Args:
        rows: Rows of the sweep's table.
        keys: Keys that were varied.
        title: Heading.
        path: The PNG file.

    Returns:
        Whether a picture was drawn. A picture needs numbers as values of the first key.

    Raises:
        OSError: If the file cannot be written.
    """
    first, *others = keys
    if not all(isinstance(row[first], int | float) for row in rows):
        return False
    figure = Figure(figsize=(7, 5), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    groups = list(dict.fromkeys(tuple(row[key] for key in others) for row in rows))
    for number, group in enumerate(groups):
        told = ", ".join(f"{key} = {value}" for key, value in zip(others, group, strict=True))
        for column, (mark, says) in LINES.items():
            points = [
                (row[first], row[column])
                for row in rows
                if tuple(row[key] for key in others) == group and row.get(column) is not None
            ]
            if points:
                label = f"{says}{': ' if told else ''}{told}"
                xy = zip(*sorted(points), strict=True)
                axes.plot(*xy, mark, color=f"C{number % 10}", markersize=5, label=in_legend(label))
    axes.set_xlabel(first, parse_math=False)
    axes.set_ylabel("load factor ζ, or factor of safety F")
    axes.set_title(heading(title), parse_math=False)
    axes.grid(alpha=0.3)
    axes.legend(loc="best", fontsize="small")
    replace_picture(path, figure)
    return True
