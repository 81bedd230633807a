"""How many times loads that stay are carried, over the factor that divides all strengths.

Single-process.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from perfplast_fenicsx.pictures.heading import heading
from perfplast_fenicsx.pictures.picture_file import replace_picture
from perfplast_fenicsx.rounding import rounded_down, rounded_up

SIDES = {
    "lower": ("#3b6ea5", "carried for certain", "stands with F = "),
    "upper": ("#d62020", "carried at most", "falls at F = "),
}
"""Colour, what a bound says of the loads, and what its factor says of the strengths."""


def save_strength(table: Mapping[str, Any], title: str, path: Path) -> None:
    """Draw both strict bounds over the factor, with the two at which they are 1.

    Args:
        table: Of :meth:`safety_factor.FactorOfSafety.table`; of an estimate the legend says so.
        title: Heading.
        path: The png file.

    Raises:
        OSError: If the file cannot be written.
    """
    figure = Figure(figsize=(7, 5), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
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
