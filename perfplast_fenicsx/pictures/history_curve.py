"""The curves of a loading history: the factor of each load over its own work. Single-process."""

from collections.abc import Sequence

import matplotlib as mpl
from matplotlib.axes import Axes

from perfplast_fenicsx.problem.report import LevelReport


def draw_history(
    axes: Axes, reports: Sequence[LevelReport], unit: str = "", now: LevelReport | None = None
) -> None:
    """Draw the factor of each load over the work that it does with the factor 1.

    Args:
        axes: Where.
        reports: Of all levels, with the ``factors`` and ``works`` of stages.
        unit: Of works.
        now: The level to be marked.
    """
    solved = [report for report in reports if report.converged]
    names = [name for name in reports[0].works if any(a.factors[name] for a in reports)]
    colours = mpl.color_sequences["tab10"]
    for number, name in enumerate(names):
        colour = colours[number % len(colours)]
        works = [0.0, *(report.works[name] for report in solved)]
        factors = [0.0, *(report.factors[name] for report in solved)]
        axes.plot(works, factors, "o-", color=colour, markersize=4, label=name)
        if now is not None:
            axes.plot(now.works[name], now.factors[name], "o", color="black", markersize=9)
    if not names:
        axes.set_title("no load but changes of temperature")
    else:
        axes.legend(loc="best")
    bracket = f" ({unit})" if unit else ""
    axes.set(xlabel=f"work of the load with factor 1{bracket}", ylabel="factor of the load")
    axes.axhline(0, color="black", linewidth=0.6)
    axes.grid(alpha=0.3)
