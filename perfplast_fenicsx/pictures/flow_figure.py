"""Draw seepage in the plane: pressure, heads, flow lines, free surface. Single-process."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.tri import LinearTriInterpolator, Triangulation

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.pictures.picture_file import drawable, replace_picture
from perfplast_fenicsx.pictures.result_reader import StoredFlow

WATER, LINES, GROUND, SURFACE = "Blues", "#1f3b5c", "#e8dfd0", "#0b5cad"
"""Colours of the pressure, the flow lines, the dry ground and the free surface."""

SATURATED = 0.5
"""Least saturation at which a point's head counts as the head of water."""


def save_flow(flow: StoredFlow, title: str, units: Mapping[str, str], path: Path) -> None:
    """Draw a flow in the plane.

    Args:
        flow: The flow.
        title: Heading.
        units: The unit of each quantity.
        path: The PNG file.

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
        wet = Triangulation(x, y, flow.cells[_saturated(flow)[flow.cells].all(axis=1)])
        if np.ptp(flow.head[np.unique(wet.triangles)]) > 1e-9 * np.ptp(flow.points):
            axes.tricontour(
                wet, flow.head, levels=12, colors="white", linewidths=0.8, linestyles="--", zorder=2
            )
            _flow_lines(axes, wet, flow)
        for line in free_surface(flow):
            axes.plot(*line.T, color=SURFACE, linewidth=2.0, solid_capstyle="round", zorder=3)
    axes.set_aspect("equal")
    length = units.get("length", "")
    names = [f"{name}{f' ({length})' if length else ''}" for name in ("x", "y")]
    axes.set(xlabel=names[0], ylabel=names[1])
    told = "dashed: equal heads; arrows: flow; thick line: free surface"
    axes.set_title(f"{drawable(title)}\n{told}", parse_math=False, fontsize=10)
    replace_picture(path, figure)


def free_surface(flow: StoredFlow) -> Floats:
    """Return the lines where the pressure, extrapolated from saturated cells, is zero.

    Pressures are zero at all points above the free surface. So in a cell that the surface crosses,
    the interpolated pressure is positive also above the surface. Therefore the function
    extrapolates the pressure head of the saturated cells linearly to the points above them. Points
    of a drain that water merely passes belong to no saturated cell, and have no surface above them.

    Args:
        flow: A flow in the plane.

    Returns:
        End points of a segment in each cell that the surface crosses, shape (num_segments, 2, 2).
    """
    saturated = _saturated(flow)
    in_water = flow.pressure > 0
    in_water[flow.cells[saturated[flow.cells].all(axis=1)]] = True
    saturated &= in_water
    crossed = flow.cells[saturated[flow.cells].any(axis=1) & ~saturated[flow.cells].all(axis=1)]
    if not len(crossed):
        return np.zeros((0, 2, 2))
    heads = _continued(flow, saturated, crossed)
    pairs = crossed[:, [[0, 1], [1, 2], [2, 0]]]  # sides of the cells; the surface crosses two
    pairs = pairs[saturated[pairs].sum(axis=2) == 1].reshape(-1, 2, 2)
    pairs = np.where(saturated[pairs[..., :1]], pairs, pairs[..., ::-1])
    below, above = heads[pairs[..., 0]], heads[pairs[..., 1]]
    shares = (below / (below - above))[..., None]
    ends = flow.points[pairs]
    return np.asarray(ends[..., 0, :] + shares * (ends[..., 1, :] - ends[..., 0, :]))


def _saturated(flow: StoredFlow) -> npt.NDArray[np.bool_]:
    return np.asarray(flow.saturation > SATURATED)


def _continued(flow: StoredFlow, saturated: npt.NDArray[np.bool_], crossed: Longs) -> Floats:
    """Return pressure heads, which are negative at points above the free surface.

    The head at a point above the surface is the mean of the values that its neighbours below
    extrapolate. Each neighbour extrapolates with the mean gradient of the total head in its
    saturated cells, or with zero gradient if it has no such cell.

    Args:
        flow: A flow in the plane.
        saturated: Flags of the points below the surface.
        crossed: Cells that the surface crosses.
    """
    count, d = flow.points.shape
    wet = flow.cells[saturated[flow.cells].all(axis=1)]
    corners, heads = flow.points[wet], flow.head[wet]
    slopes = np.linalg.solve(
        corners[:, 1:] - corners[:, :1], (heads[:, 1:] - heads[:, :1])[..., None]
    )
    sums, number = np.zeros((count, d)), np.zeros(count)
    np.add.at(sums, wet.ravel(), np.repeat(slopes[..., 0], d + 1, axis=0))
    np.add.at(number, wet.ravel(), 1.0)
    slope = sums / np.maximum(number, 1.0)[:, None]
    pairs = crossed[:, [[0, 1], [1, 2], [2, 0], [1, 0], [2, 1], [0, 2]]].reshape(-1, 2)
    below, above = pairs[saturated[pairs[:, 0]] & ~saturated[pairs[:, 1]]].T
    apart = flow.points[above] - flow.points[below]
    given = flow.head[below] + np.einsum("pi,pi->p", slope[below], apart)
    total, number = np.zeros(count), np.zeros(count)
    np.add.at(total, above, given)
    np.add.at(number, above, 1.0)
    dry = number > 0
    pressure = flow.head - flow.height
    little = 1e-6 * float(np.ptp(flow.points))
    found = np.maximum(pressure, little)
    found[dry] = np.minimum(total[dry] / number[dry] - flow.height[dry], -little)
    return found


def _flow_lines(axes: Axes, wet: Triangulation, flow: StoredFlow) -> None:
    """Draw flow lines along the gradient of the head, as in isotropic ground."""
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
    number = 160  # number of grid points along the longer side
    step = np.max(high - low) / number
    grid: list[Floats] = [np.arange(a, b + step / 2, step) for a, b in zip(low, high, strict=True)]
    x, y = np.meshgrid(*grid)
    u, v = (LinearTriInterpolator(wet, values)(x, y) for values in at_points.T)
    axes.streamplot(
        grid[0], grid[1], u, v, color=LINES, linewidth=0.6, arrowsize=0.7, density=0.8, zorder=2
    )
