"""Draw the curves of a loading history: each factor with its response. Single-process."""

from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes

from perfplast_fenicsx.pictures.heading import in_legend
from perfplast_fenicsx.problem.judged.state import LevelReport


def draw_history(
    axes: Axes, reports: Sequence[LevelReport], unit: str = "", now: LevelReport | None = None
) -> None:
    """Draw the factor of each load over the work that it does with the factor 1.

    If no load has a factor, the driving forces of motions are drawn over their factors.

    Args:
        axes: Axes to draw into.
        reports: Reports of all levels, with the ``factors``, ``works`` and ``driving_forces`` of
            stages.
        unit: Unit of works.
        now: Level to be marked.
    """
    solved = [report for report in reports if report.converged]
    bracket = f" ({unit})" if unit else ""
    labels = (f"work of the load with factor 1{bracket}", "factor of the load")
    names = [name for name in reports[0].works if any(a.factors[name] for a in reports)]
    moved = not names and any(report.driving_forces for report in reports)
    if moved:
        names = list(reports[0].driving_forces)
        labels = ("factor of the motion", "driving force of the motion with factor 1")

    def place(report: LevelReport, name: str) -> tuple[float, float]:
        factor = report.factors[name]
        return (factor, report.driving_forces[name]) if moved else (report.works[name], factor)

    colours = mpl.color_sequences["tab10"]
    for number, name in enumerate(names):
        line = np.array([(0.0, 0.0), *(place(report, name) for report in solved)])
        colour, label = colours[number % len(colours)], in_legend(name)
        axes.plot(*line.T, "o-", color=colour, markersize=4, label=label)
        if now is not None:
            axes.plot(*place(now, name), "o", color="black", markersize=9)
    if not names:
        axes.set_title("no load but changes of temperature")
    else:
        axes.legend(loc="best")
    axes.set(xlabel=labels[0], ylabel=labels[1])
    axes.axhline(0, color="black", linewidth=0.6)
    axes.grid(alpha=0.3)
