"""Draws ``fields.png`` from a surface file; run as a program of its own.

:mod:`perfplast_fenicsx.plotting` starts it, so that a graphics system that fails takes nothing with
it. Hence nothing of this package or of MPI is imported here. pyvista draws the bodies, matplotlib
puts words and colour bars around them.
"""

import json
import sys
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
import pyvista as pv
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colorbar import Colorbar
from matplotlib.colors import Colormap, LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

Floats = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

HUES = ("#3b6ea5", "#8a6d3b", "#4a8a5a", "#7a5a96")
"""Colour of the highest elastic stress, for each body in turn."""

PLASTIC = "#d62020"
PLASTIC_FROM = 0.9999
"""A yield ratio above this is plastic; the law gives 1 up to rounding."""

VIEWS = np.array([(1.1, -1.9, 1.0), (-1.1, -1.9, 1.0), (1.1, 1.9, 1.0), (-1.1, 1.9, 1.0)])
PIXELS = (1000, 800)
SHARP = 30.0
"""Edges between facets that differ by more degrees are drawn."""

MOST_EDGES = 40_000
"""The mesh is drawn where it has no more triangles than this."""

ARROWS = 24
"""About so many arrows show a load."""

ARROW = 0.1
"""Their length relative to the size of the assembly."""


@dataclass
class Panel:
    """The bodies with one quantity as colour.

    Attributes:
        title: Says what is seen.
        colours: RGB, shape (num_points, 3) or (num_triangles, 3).
        bars: Colour map, range and label of each colour bar.
        solid: Triangles that are opaque, shape (num_triangles,); the others are like glass.
        loads: Draw the loads.
    """

    title: str
    colours: Floats
    bars: list[tuple[Colormap, Normalize, str]]
    solid: Flags
    loads: bool = False


class Scene:
    """The deformed bodies of a surface file, and the direction they are looked at from."""

    def __init__(self, data: dict[str, npt.NDArray[Any]], about: dict[str, Any]) -> None:
        self.data, self.about = data, about
        self.triangles, self.body = data["triangles"], data["body"]
        self.undeformed = data["points"]
        self.points = data["points"] + about["scale"] * data["displacement"]
        self.size = float(np.linalg.norm(np.ptp(self.undeformed, axis=0)))
        self.flat = bool(np.ptp(self.undeformed[:, 2]) == 0)
        a, b, c = (self.undeformed[self.triangles[:, i]] for i in range(3))
        self.areas = np.cross(b - a, c - a) / 2
        self.outlines = [self._outline(body) for body in range(len(about["names"]))]
        self.view = self._view()

    def draw(self, panel: Panel) -> npt.NDArray[np.uint8]:
        """An image of the panel, shape (height, width, 3)."""
        plotter = pv.Plotter(off_screen=True, window_size=list(PIXELS))
        plotter.set_background("white")
        at_points = len(panel.colours) == len(self.points)
        plotter.add_mesh(
            self._mesh(self.points, panel.solid),
            scalars=panel.colours if at_points else panel.colours[panel.solid],
            rgb=True,
            lighting=not self.flat,
            ambient=0.6,
            diffuse=0.45,
            show_edges=len(self.triangles) <= MOST_EDGES,
            edge_color="#404040",
            edge_opacity=0.2,
            line_width=0.5,
        )
        for body in range(len(self.outlines)):
            glass = ~panel.solid & (self.body == body)
            if glass.any():
                mesh = self._mesh(self.points, glass)
                plotter.add_mesh(mesh, color=_hue(body), opacity=0.12, lighting=False)
        for before, after in self.outlines:
            plotter.add_mesh(before, color="#b0b0b0", line_width=1.5, lighting=False)
            plotter.add_mesh(after, color="#202020", line_width=2.5, lighting=False)
        plotter.view_vector(self.view, viewup=(0, 1, 0) if self.flat else (0, 0, 1))
        plotter.enable_parallel_projection()
        if panel.loads:
            for start, vector in self._arrows():
                plotter.add_arrows(start, vector, color="#111111", lighting=False)
        self._frame(plotter)
        plotter.enable_anti_aliasing("ssaa")
        image = plotter.screenshot(return_img=True)
        plotter.close()
        return np.asarray(image)

    def _frame(self, plotter: pv.Plotter) -> None:
        """Fill the image with what there is to see, loads included, alike in all panels."""
        towards = np.array(self.view) / np.linalg.norm(self.view)
        right = np.cross(plotter.camera.up, towards)
        right /= np.linalg.norm(right)
        axes = np.array([right, np.cross(towards, right)])
        seen = np.concatenate([self.points, self.undeformed, *(a for a, _ in self._arrows())])
        low, high = (seen @ axes.T).min(axis=0), (seen @ axes.T).max(axis=0)
        half = (high - low) / 2
        centre = (low + high) / 2 @ axes + (seen.mean(axis=0) @ towards) * towards
        plotter.camera.focal_point = centre
        plotter.camera.position = centre + 3 * self.size * towards
        plotter.camera.parallel_scale = 1.04 * max(half[1], half[0] * PIXELS[1] / PIXELS[0])
        plotter.reset_camera_clipping_range()

    def _mesh(self, points: Floats, chosen: Flags) -> pv.PolyData:
        faces = np.column_stack([np.full(chosen.sum(), 3), self.triangles[chosen]])
        return pv.PolyData(points, faces.ravel())

    def _outline(self, body: int) -> tuple[pv.PolyData, pv.PolyData]:
        """Sharp edges of a body before and after the deformation.

        They are found before it, where an edge that bends is sharp all along.
        """
        mesh = self._mesh(self.undeformed, self.body == body)
        mesh.point_data["moved"] = self.points
        before = mesh.clean().extract_feature_edges(
            SHARP, boundary_edges=self.flat, manifold_edges=False, non_manifold_edges=False
        )
        after = before.copy()
        after.points = before.point_data["moved"]
        return before, after

    def _view(self) -> tuple[float, float, float]:
        """Of a few directions the first that sees nearly the most of the stressed skin."""
        if self.flat:
            return (0.0, 0.0, 1.0)
        weighed = self.areas * (self.data["yield_ratio"] ** 4 + 1e-6)[:, None]
        weighed = weighed[~self.data["contact"]]
        seen = np.maximum(weighed @ VIEWS.T, 0).sum(axis=0)
        x, y, z = VIEWS[int(np.argmax(seen > 0.95 * seen.max()))]
        return (x, y, z)

    def _arrows(self) -> list[tuple[Floats, Floats]]:
        """Start and vector of the arrows of each load: they end on the surface, or pull at it."""
        arrows = []
        for mark, direction in self.about["loads"].items():
            chosen = np.flatnonzero(self.data[mark])
            areas = self.areas[chosen]
            total = np.linalg.norm(areas, axis=1).sum()
            if total > 0:
                centres = self.points[self.triangles[chosen]].mean(axis=1)
                boxes = np.floor(centres / np.sqrt(total / ARROWS) + 1e-3)
                spread = np.unique(boxes, axis=0, return_index=True)[1]
                d = np.broadcast_to(direction, areas.shape)[spread]
                if isinstance(direction, float):  # along the outward normal
                    d = d * areas[spread]
                d = ARROW * self.size * d / np.linalg.norm(d, axis=1, keepdims=True)
                pushes = np.einsum("ni,ni->", d, areas[spread]) < 0
                arrows.append((centres[spread] - d * pushes, d))
        return arrows


def panels(scene: Scene) -> list[Panel]:
    """What the picture shows: plastic zone, displacement, and contact pressure if any."""
    everything = np.ones(len(scene.triangles), dtype=bool)
    ratio = scene.data["yield_ratio"]
    colours = np.zeros((len(ratio), 3))
    bars: list[tuple[Colormap, Normalize, str]] = []
    for body, name in enumerate(scene.about["names"]):
        hue = _stress_map(_hue(body))
        own = scene.body == body
        colours[own] = hue(ratio[own])[:, :3]
        bars.append((hue, Normalize(0, 100), name))
    heading = "Stress in % of the yield stress (red: plastic)"
    found = [Panel(heading, colours, bars, everything, loads=True)]

    size = np.linalg.norm(scene.data["displacement"], axis=1)
    found.append(_graded("Displacement", size, "viridis", "magnitude of u", everything))
    contact = scene.data["contact"]
    if contact.any():
        pressure = scene.data["contact_pressure"]
        label = "pressure on the contact surface"
        found.append(
            _graded(
                "Contact pressure, seen through the bodies", pressure, "magma_r", label, contact
            )
        )
    return found


def _graded(title: str, values: Floats, colormap: str, label: str, solid: Flags) -> Panel:
    largest = float(values.max(initial=0.0))
    colours = mpl.colormaps[colormap]
    norm = Normalize(min(0.0, float(values.min(initial=0.0))), largest if largest > 0 else 1.0)
    return Panel(title, colours(norm(values))[:, :3], [(colours, norm, label)], solid)


def _hue(body: int) -> str:
    return HUES[body % len(HUES)]


def _stress_map(hue: str) -> Colormap:
    """Pale to ``hue`` for elastic stress, then red at once."""
    stops = [(0.0, "#f6f6f2"), (PLASTIC_FROM, hue), (PLASTIC_FROM, PLASTIC), (1.0, PLASTIC)]
    return LinearSegmentedColormap.from_list("stress", stops, N=20_000)


def compose(scene: Scene, path: str) -> None:
    """Draw all panels, put words around them, and save the picture."""
    shown = panels(scene)
    figure = Figure(figsize=(5.4 * len(shown), 5.9), dpi=140)
    FigureCanvasAgg(figure)
    figure.suptitle(scene.about["title"], fontsize=16, fontweight="bold", y=0.98)
    figure.text(0.5, 0.89, scene.about["subtitle"], ha="center", fontsize=11.5)
    width = 1 / len(shown)
    for i, panel in enumerate(shown):
        axes = figure.add_axes((i * width, 0.14, width, 0.68))
        axes.imshow(scene.draw(panel))
        axes.set_axis_off()
        axes.set_title(panel.title, fontsize=12)
        share = 0.8 / len(panel.bars)
        for k, (colours, norm, label) in enumerate(panel.bars):
            left = (i + 0.1 + k * share + 0.03) * width
            bar = Colorbar(
                figure.add_axes((left, 0.12, (share - 0.06) * width, 0.022)),
                cmap=colours,
                norm=norm,
                orientation="horizontal",
                ticks=MaxNLocator(4 if len(panel.bars) > 1 else 6),
            )
            bar.set_label(label, fontsize=10)
            bar.ax.tick_params(labelsize=9)
    figure.savefig(path)


def main(source: str, target: str) -> None:
    """Draw the surface file ``source`` (npz) as ``target`` (png)."""
    with np.load(source) as file:
        data = {name: file[name] for name in file.files}
    about = json.loads(str(data.pop("about")))
    compose(Scene(data, about), target)


if __name__ == "__main__":
    main(*sys.argv[1:])
