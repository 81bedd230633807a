"""Water that flows through ground in the plane: pressure, heads, flow lines, free surface.

Single-process.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.tri import LinearTriInterpolator, Triangulation

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.pictures.heading import drawable
from perfplast_fenicsx.pictures.picture_file import replace_picture
from perfplast_fenicsx.pictures.result_reader import StoredFlow

WATER, LINES, GROUND = "Blues", "#1f3b5c", "#e8dfd0"
"""Colours: pressure, lines of the flow, dry ground."""


def save_flow(flow: StoredFlow, title: str, units: Mapping[str, str], path: Path) -> None:
    """Draw a flow in the plane.

    Args:
        flow: The flow.
        title: Heading.
        units: The unit of each quantity.
        path: The png file.

    Raises:
        OSError: If the file cannot be written.
    """
    x, y = flow.points.T
    mesh = Triangulation(x, y, flow.cells)
    width, height = np.ptp(flow.points, axis=0)
    tall = float(np.clip(9.0 * height / width + 1.2, 3.0, 10.0))
    figure = Figure(figsize=(10, tall), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    axes.tripcolor(
        mesh, np.zeros(len(x)), cmap=ListedColormap([GROUND]), shading="gouraud", zorder=0
    )
    largest = float(flow.pressure.max(initial=0.0))
    if largest > 0:
        least = 1e-6 * largest
        levels = np.linspace(least, largest, 12)
        water = axes.tricontourf(mesh, flow.pressure, levels=levels, cmap=WATER, zorder=1)
        unit = units.get("stress", "")
        label = f"pore pressure{f' ({unit})' if unit else ''}"
        figure.colorbar(water, ax=axes, label=label, ticks=np.linspace(0.0, largest, 6))
        saturated = 0.5  # value of the saturation that is drawn as the free surface
        wet = Triangulation(x, y, flow.cells[flow.saturation[flow.cells].min(axis=1) > saturated])
        if np.ptp(flow.head[np.unique(wet.triangles)]) > 1e-9 * np.ptp(flow.points):
            axes.tricontour(
                wet, flow.head, levels=12, colors="white", linewidths=0.8, linestyles="--", zorder=2
            )
            _flow_lines(axes, wet, flow)
        if flow.saturation.min() < saturated:
            axes.tricontour(
                mesh,
                flow.saturation,
                levels=[saturated],
                colors="#0b5cad",
                linewidths=2.0,
                zorder=3,
            )
    axes.set_aspect("equal")
    length = units.get("length", "")
    names = [f"{name}{f' ({length})' if length else ''}" for name in ("x", "y")]
    axes.set(xlabel=names[0], ylabel=names[1])
    told = "dashed: equal heads; arrows: flow; thick line: free surface"
    axes.set_title(f"{drawable(title)}\n{told}", parse_math=False, fontsize=10)
    replace_picture(path, figure)


def _flow_lines(axes: Axes, wet: Triangulation, flow: StoredFlow) -> None:
    """Draw lines along the slope of the head, which the water follows in isotropic ground."""
    corners = flow.points[wet.triangles]
    sides = corners[:, 1:] - corners[:, :1]
    rises = flow.head[wet.triangles]
    slopes = np.linalg.solve(sides, (rises[:, 1:] - rises[:, :1])[..., None])[..., 0]
    velocity = -slopes
    at_points = np.zeros_like(flow.points)
    count = np.zeros(len(flow.points))
    np.add.at(at_points, wet.triangles.ravel(), np.repeat(velocity, 3, axis=0))
    np.add.at(count, wet.triangles.ravel(), 1.0)
    at_points /= np.maximum(count, 1.0)[:, None]
    low, high = flow.points.min(axis=0), flow.points.max(axis=0)
    number = 160  # points of the grid along the longer side
    step = np.max(high - low) / number
    grid: list[Floats] = [np.arange(a, b + step / 2, step) for a, b in zip(low, high, strict=True)]
    x, y = np.meshgrid(*grid)
    u, v = (LinearTriInterpolator(wet, values)(x, y) for values in at_points.T)
    axes.streamplot(
        grid[0], grid[1], u, v, color=LINES, linewidth=0.6, arrowsize=0.7, density=0.8, zorder=2
    )
