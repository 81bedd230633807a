"""Draw loading curves: load factor ζ over the work of the loads α, force over stroke, histories.

Single-process.
"""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from perfplast_fenicsx.pictures.path_points import between, from_rest
from perfplast_fenicsx.pictures.picture_file import in_legend, replace_picture
from perfplast_fenicsx.pictures.result_reader import FAR
from perfplast_fenicsx.problem.judged.report import LevelReport


def draw_history(
    axes: Axes, reports: Sequence[LevelReport], unit: str = "", now: LevelReport | None = None
) -> None:
    """Plot the factor of each load over the work that the load would do with factor 1.

    If no load has a factor, the function draws the driving forces of motions over their factors.

    Args:
        axes: Axes to draw into.
        reports: Reports of all levels, with the ``factors``, ``works`` and ``driving_forces`` of
            stages.
        unit: Unit of work.
        now: Level to mark.
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
        axes.set_title("only changes of temperature")
    else:
        axes.legend(loc="best")
    axes.set(xlabel=labels[0], ylabel=labels[1])
    axes.axhline(0, color="black", linewidth=0.6)
    axes.grid(alpha=0.3)


LINE, ELASTIC, LIMIT = "#3b6ea5", "#707070", "#d62020"


class Bounds(Protocol):
    """A limit load in the form that a curve needs (:class:`limit_load.LimitLoad`)."""

    @property
    def lower(self) -> float:
        """Return the load factor of the static side, or the largest one that a path has reached."""

    @property
    def estimate(self) -> float | None:
        """Return the estimate of the limit load; None if the curve does not level off."""

    @property
    def upper(self) -> float | None:
        """Return the load factor of the kinematic side; None if it is not known."""

    @property
    def theorem(self) -> bool:
        """Return whether the two sides bound a limit load, not only the load where a path ends."""


def save_curve(
    reports: Sequence[LevelReport],
    title: str,
    path: Path,
    limit: Bounds | None,
    unit: str = "",
    driven: bool = False,
) -> None:
    """Draw the loading curve of a run, and save the picture.

    Args:
        reports: Reports of all levels.
        title: Heading.
        path: The PNG file.
        limit: Limit load to mark with its bounds.
        unit: Unit of α.
        driven: Whether ζ moves supports and obstacles.

    Raises:
        OSError: If the file cannot be written.
    """
    figure = Figure(figsize=(7, 5), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    if driven:
        draw_stroke(axes, reports, unit)
    else:
        draw_curve(axes, reports, limit, unit)
    axes.set_title(title, parse_math=False)
    replace_picture(path, figure)


def draw_curve(
    axes: Axes,
    reports: Sequence[LevelReport],
    limit: Bounds | None = None,
    unit: str = "",
    now: LevelReport | None = None,
) -> None:
    """Draw ζ over α at solved levels, the elastic line, the limit, and each ζ without a solution.

    For a history, the function draws the factors of loads (:func:`draw_history`).
    """
    if any(report.factors for report in reports):
        draw_history(axes, reports, unit, now)
        return
    solved = [report for report in reports if report.converged]
    alphas, zetas = from_rest(solved)
    axes.plot(*between(alphas, zetas), color=LINE)
    axes.plot(alphas, zetas, "o", color=LINE, markersize=5, label="solved load levels")
    if solved and solved[0].plastic_cells == 0 and solved[0].zeta > 0:
        slope = solved[0].alpha / solved[0].zeta
        top = max(zetas) * 1.05
        straight = np.linspace(0, top, 200)  # a straight line appears curved on a logarithmic axis
        axes.plot(slope * straight, straight, ":", color=ELASTIC, label="elastic")
    for report in reports:
        if not report.converged:
            label = f"no solution found at ζ = {report.zeta:.6g}"
            axes.axhline(report.zeta, color=LIMIT, linestyle="--", label=label)
    if limit is not None and limit.estimate is not None:
        known = "limit load of this mesh," if limit.theorem else "this path loses equilibrium at"
        label = f"{known} {limit.estimate:.4g}"
        axes.axhline(limit.estimate, color=LIMIT, linewidth=1, label=label)
        if limit.upper is not None and math.isfinite(limit.lower):
            label = f"its two sides on this mesh, {limit.lower:.6g} and {limit.upper:.6g}"
            if not limit.theorem:
                label = f"from {limit.lower:.6g} (solved) to {limit.upper:.6g} (no equilibrium)"
            axes.axhspan(limit.lower, limit.upper, color=LIMIT, alpha=0.15, label=label)
    far = len(solved) > 1 and solved[-1].alpha > FAR * solved[0].alpha > 0
    if far:
        axes.set_xscale("symlog", linthresh=solved[0].alpha)
    if now is not None:
        axes.plot(now.alpha, now.zeta, "o", color="black", markersize=9, zorder=5)
    bracket = f" ({unit})" if unit else ""
    scale = ", logarithmic axis" if far else ""
    axes.set(xlabel=f"work of the loads α{bracket}{scale}", ylabel="load factor ζ")
    axes.set_xlim(left=0)
    axes.set_ylim(bottom=0)
    axes.grid(alpha=0.3)
    axes.legend(loc="lower right")


def draw_stroke(
    axes: Axes,
    reports: Sequence[LevelReport],
    unit: str = "",
    now: tuple[float, float] | None = None,
) -> None:
    """Draw the driving force over the stroke ζ at the converged levels.

    Args:
        axes: Axes to draw into.
        reports: Reports of all levels.
        unit: Unit of work.
        now: Point (ζ, force) to mark.
    """
    solved = [report for report in reports if report.converged]
    strokes = [report.zeta for report in solved]
    forces = [report.driving_force for report in solved]
    axes.axhline(0, color=ELASTIC, linewidth=0.8)
    axes.axvline(0, color=ELASTIC, linewidth=0.8)
    axes.plot(strokes, forces, "o-", color=LINE, markersize=5, label="solved load levels")
    for report in reports:
        if not report.converged:
            label = f"no solution found at ζ = {report.zeta:.6g}"
            axes.axvline(report.zeta, color=LIMIT, linestyle="--", label=label)
    if now is not None:
        axes.plot(*now, "o", color="black", markersize=9, zorder=5)
    bracket = f" (work per unit of ζ, {unit})" if unit else ""
    axes.set(xlabel="load factor ζ of the motion", ylabel=f"driving force{bracket}")
    axes.grid(alpha=0.3)
    axes.legend(loc="lower right")
