"""Draw a case before the run: bodies with loads, supports, contacts and free surfaces.

Pictures of plane bodies do not import VTK, so the run itself draws them; pictures of 3D bodies are
left to the drawing process (:mod:`drawing_process`).
"""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from scipy.spatial import cKDTree

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.pictures.picture_file import (
    BACK,
    FRONT,
    PLANE,
    REVOLVED,
    View,
    draw_axes,
    edges_of_cells,
    heading,
    in_legend,
    replace_picture,
)

if TYPE_CHECKING:
    import pyvista as pv

FREE, REST = "#d9d9d9", "#ffc680"
"""Colours of free surfaces, and of the remaining part of a side with a named part."""

HUES = {
    "load": ("#c1121f", "#e85d75", "#8c1c4b", "#ff7b54"),
    "support": ("#1d4e89", "#3d8bd4", "#00796b", "#6a5acd"),
    "contact": ("#5b8c3a", "#8fb339", "#3f6b2a", "#a3c585"),
}
"""Colours of loaded surfaces, supports and contacts, used in turn."""

FILLED = ("#efe3c8", "#dfe8d2", "#e6d8cf", "#d9e2ea", "#f2ead9", "#dcd7e6")
"""Colours of plane bodies, used in turn if there are several."""

WATER = "#1874b8"
"""Colour of the water table."""

Arrays = Mapping[str, npt.NDArray[Any]]


def save_case(arrays: Arrays, output: Path) -> None:
    """Draw a case from its :func:`~perfplast_fenicsx.cli.case_picture.arrays_of`."""
    flat = arrays["x"].shape[2] == 2
    views = [REVOLVED if arrays["revolved"] else PLANE] if flat else [FRONT, BACK]
    colours = _colours(arrays)
    handles = [
        Patch(color=colours[number], label=in_legend(str(label)))
        for number, label in enumerate(arrays["labels"])
    ]
    if arrays["rest"].any():
        words = "rest of the same side, not covered"
        handles.append(Patch(facecolor=REST, hatch="///", edgecolor="#7f4f00", label=words))
    handles.append(Patch(color=FREE, label="free"))
    if len(arrays["water"]):
        handles.append(Patch(color=WATER, label="water table"))
    below = 0.35 + 0.23 * len(handles)  # inches
    above, high, wide = 0.7, 5.4, 7.0
    if flat:  # figure with the aspect ratio of the bodies
        low, top = arrays["x"].reshape(-1, 2).min(axis=0), arrays["x"].reshape(-1, 2).max(axis=0)
        wide = 10.0
        high = float(np.clip(wide * (top - low)[1] / max((top - low)[0], 1e-300), 2.0, 8.0))
    figure = Figure(figsize=(wide * len(views), above + high + below), dpi=100)
    FigureCanvasAgg(figure)
    for place, view in enumerate(views, start=1):
        axes = figure.add_subplot(1, len(views), place)
        if flat:
            _draw_plane(axes, arrays, colours)
        else:
            axes.imshow(_image(arrays, colours, view))
            axes.set_title(view.words, y=1.0, fontsize=10)
        axes.set_axis_off()
        draw_axes(axes.inset_axes((0.0, 0.86, 0.1, 0.13)), view)
    figure.legend(handles=handles, loc="lower left", frameon=False, fontsize=9)
    figure.suptitle(
        heading(str(arrays["title"])), y=1 - 0.2 / figure.get_figheight(), parse_math=False
    )
    whole = figure.get_figheight()
    figure.subplots_adjust(0.02, below / whole, 0.98, 1 - above / whole, wspace=0.02)
    replace_picture(output, figure)


def _colours(arrays: Arrays) -> list[str]:
    """Return a colour for each label, according to its first role."""
    used: dict[str, int] = {}
    found = []
    for role in map(str, arrays["roles"]):
        kind = {"load": "load", "support": "support", "rigid": "support"}.get(role, "contact")
        hues = HUES[kind]
        found.append(hues[used.get(kind, 0) % len(hues)])
        used[kind] = used.get(kind, 0) + 1
    return found


def _of_facets(arrays: Arrays, colours: list[str]) -> npt.NDArray[np.str_]:
    """Return the colour of each facet, shape (n,)."""
    found = np.where(arrays["rest"], REST, FREE)
    mark = arrays["mark"]
    table = np.array([*colours, FREE])
    return np.where(mark >= 0, table[mark], found)


def _draw_plane(axes: Axes, arrays: Arrays, colours: list[str]) -> None:
    """Draw plane bodies: their cells, and their edges as thick lines."""
    axes.set_aspect("equal")
    x = np.asarray(arrays["x"], dtype=np.float64)
    _fill(axes, arrays)
    shown = _of_facets(arrays, colours)
    for colour, width in ((FREE, 2.0), (REST, 5.0), (None, 5.0)):
        some = (shown == colour) if colour else ~np.isin(shown, [FREE, REST])
        edges = LineCollection(
            list(x[some]), colors=shown[some].tolist(), lw=width, capstyle="butt"
        )
        if colour == REST:
            edges.set_linestyle((0, (1.2, 0.6)))
        axes.add_collection(edges)
    low, high = x.reshape(-1, 2).min(axis=0), x.reshape(-1, 2).max(axis=0)
    if len(water := np.asarray(arrays["water"], dtype=np.float64)):
        along = np.unique(np.clip(water[:, 0], low[0], high[0]))
        level = np.interp(along, *water.T)
        axes.plot(along, level, color=WATER, lw=1.5, ls=(0, (6, 2)), zorder=4)
        axes.plot(along[-1:] - 0.02 * np.ptp(along), level[-1:], marker=7, ms=7, color=WATER)
        high[1] = max(high[1], level.max())
    size = float(np.linalg.norm(high - low))
    for place, force, number in _arrows(arrays):
        along = force / (np.linalg.norm(force) or 1.0)
        start = place - 0.12 * size * along
        low, high = np.minimum(low, start), np.maximum(high, start)
        style: dict[str, Any] = {"arrowstyle": "-|>", "color": colours[number], "lw": 2}
        axes.annotate(
            "",
            (place[0], place[1]),
            (start[0], start[1]),
            arrowprops=style | {"shrinkA": 0, "shrinkB": 0},
        )
    margin = 0.03 * size
    axes.set_xlim(low[0] - margin, high[0] + margin)
    axes.set_ylim(low[1] - margin, high[1] + margin)


def _fill(axes: Axes, arrays: Arrays) -> None:
    """Fill the cells with the colours of their bodies; with several bodies, write their names."""
    cells, bodies, names = arrays["cells"], arrays["bodies"], arrays["names"]
    several = len(names) > 1
    ends = np.asarray(arrays["x"], dtype=np.float64)
    edges = np.concatenate([ends[:, 0], ends[:, 1], ends.mean(axis=1)])
    for number, name in enumerate(names):
        own = cells[bodies == number]
        if not len(own):
            continue
        colour = FILLED[number % len(FILLED)] if several else "#f2f2f2"
        axes.add_collection(
            PolyCollection(list(own), facecolor=colour, edgecolor="#dddddd", lw=0.3)
        )
        if several:
            middles = own.mean(axis=1)
            x, y = middles[np.argmax(cKDTree(edges).query(middles)[0])]  # farthest from all edges
            style: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": 9}
            axes.text(x, y, str(name), color="#303030", parse_math=False, zorder=5, **style)


def _image(arrays: Arrays, colours: list[str], view: View) -> npt.NDArray[np.uint8]:
    """Return an image of 3D bodies from one direction, shape (height, width, 3)."""
    import pyvista as pv

    x = np.asarray(arrays["x"], dtype=np.float64)
    pixels = (1000, 780)
    plotter = pv.Plotter(off_screen=True, window_size=list(pixels))
    plotter.set_background("white")
    shown = _of_facets(arrays, colours)
    sharp = 30.0  # angle (degrees) between facets above which an edge is drawn
    for body in np.unique(arrays["body"]):
        own = arrays["body"] == body
        for colour in np.unique(shown[own]):
            mesh = _mesh(x[own & (shown == colour)])
            style = {"ambient": 0.5, "diffuse": 0.5, **edges_of_cells(len(x))}
            plotter.add_mesh(mesh, color=str(colour), **style)
            border = mesh.clean().extract_feature_edges(
                feature_edges=False, manifold_edges=False, non_manifold_edges=False
            )
            if border.n_points:
                plotter.add_mesh(border, color="#303030", line_width=1.5, lighting=False)
        edges = (
            _mesh(x[own])
            .clean()
            .extract_feature_edges(
                sharp, boundary_edges=False, manifold_edges=False, non_manifold_edges=False
            )
        )
        if edges.n_points:
            plotter.add_mesh(edges, color="#303030", line_width=1.5, lighting=False)
    corners = x.reshape(-1, 3)
    size = float(np.linalg.norm(np.ptp(corners, axis=0)))
    ends: list[Floats] = [corners]
    for place, force, number in _arrows(arrays):
        along = force / (np.linalg.norm(force) or 1.0)
        length = 0.15 * size
        ends.append((place - length * along)[None])
        arrow = pv.Arrow(start=ends[-1][0], direction=along, scale=length)
        plotter.add_mesh(arrow, color=colours[number])
    plotter.view_vector(view.towards, viewup=view.up)
    plotter.enable_parallel_projection()
    centre, half_height = view.fitted(np.concatenate(ends), pixels)
    plotter.camera.focal_point = centre
    plotter.camera.position = centre + 2 * size * view.frame[2]
    plotter.camera.parallel_scale = half_height
    plotter.reset_camera_clipping_range()
    plotter.enable_anti_aliasing("ssaa")
    image = np.asarray(plotter.screenshot(return_img=True), dtype=np.uint8)[..., :3]
    plotter.close()
    return image


def _arrows(arrays: Arrays) -> list[tuple[Floats, Floats, int]]:
    """Return the positions and resultants of loads, and the label of each load."""
    triples = zip(arrays["places"], arrays["forces"], arrays["of_force"], strict=True)
    return [
        (np.asarray(place, dtype=np.float64), np.asarray(force, dtype=np.float64), int(number))
        for place, force, number in triples
        if np.any(force)
    ]


def _mesh(x: Floats) -> "pv.PolyData":
    """Return a mesh of triangles with given corners, shape (n, 3, 3)."""
    import pyvista as pv

    numbers: Longs = np.arange(3 * len(x)).reshape(-1, 3)
    return pv.PolyData(x.reshape(-1, 3), faces=np.column_stack([np.full(len(x), 3), numbers]))
