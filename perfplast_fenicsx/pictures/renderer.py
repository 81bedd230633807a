"""Render images of the deformed bodies with VTK, and compose panels from the images.

A failure of the graphics system may end the process. Therefore only the drawing process imports
this module (:mod:`drawing_process`).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
import pyvista as pv
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colorbar import Colorbar
from matplotlib.colors import Colormap, LinearSegmentedColormap, LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.contact.declared.obstacles import Obstacle
from perfplast_fenicsx.io.case.scene import Scene
from perfplast_fenicsx.pictures.annotations import load_arrows, sample_obstacles
from perfplast_fenicsx.pictures.boundary_surface import Surface
from perfplast_fenicsx.pictures.picture_file import (
    View,
    draw_axes,
    drawable,
    edges_of_cells,
    view_of,
)
from perfplast_fenicsx.problem.declared.loads import Load
from perfplast_fenicsx.problem.judged.report import LevelReport
from perfplast_fenicsx.rounding import ROUNDING
from perfplast_fenicsx.units import Units

HUES = ("#6c9bcd", "#b5945c", "#74b386", "#a587c4")
"""Colour of the highest elastic stress, for each body in turn."""


PLASTIC = "#b81414"
"""Colour of plastic cells, darker than the hues, so it differs from them in greyscale too."""


@dataclass
class Panel:
    """An image of the bodies in which colours show one quantity.

    Attributes:
        title: Heading of the panel.
        colours: RGB of each point, or of each triangle, in each frame, shape (num_frames, n, 3). A
            fourth column is the opacity, if the background is visible.
        bars: Colour map, range and label of each colour bar.
        facets: Flags of the facets that are coloured, over transparent bodies; None for all
            triangles.
        loads: Whether the loads are drawn.
    """

    title: str
    colours: Floats
    bars: list[tuple[Colormap, Normalize, str]]
    facets: npt.NDArray[np.bool_] | None = None
    loads: bool = False


def panels(
    frames: Sequence[Surface],
    units: Units,
    largest_dissipation: float | None = None,
    middle: bool = True,
    unique: bool = True,
) -> list[Panel]:
    """Return the panels of a picture: plastic zone, displacement or dissipation, and contact.

    Args:
        frames: One skin in one or more states, with equal scales in all frames. The skins have
            ``displacement``, ``contact_pressure``, the mark ``contact``, and, unless bodies are
            rigid, ``yield_ratio``. Mechanisms also have ``dissipation``, if it is to be shown. If
            ``slip`` and ``friction_stress`` exist, they are shown in addition to the displacement.
            If ``accumulated_plastic_strain`` exists, it is shown instead of the displacement.
        units: Units for the legends.
        largest_dissipation: Largest dissipation of all cells, including inner cells; only for
            mechanisms.
        middle: Whether to show displacement or dissipation.
        unique: Whether the stress is unique, as at a level. The stress of a limit load is arbitrary
            where there is no plastic flow; then the label of the contact pressure states this.
    """
    found = [_stress(frames)] if "yield_ratio" in frames[0].at_cells else []
    if "accumulated_plastic_strain" in frames[-1].at_cells and largest_dissipation is None:
        found.append(_flow(frames))
    elif not middle:
        pass
    elif largest_dissipation is not None:
        found.append(_mechanism(frames, largest_dissipation))
    else:
        size = np.linalg.norm([a.at_points["displacement"] for a in frames], axis=2)
        label = f"magnitude of u ({units.of_length()})"
        colours = mpl.colormaps["viridis"]
        found.append(_graded("Displacement", size, _from_zero(size), colours, label))
    if frames[0].marks["contact"].any():
        pressure = np.array([a.at_points["contact_pressure"] for a in frames])
        label = f"pressure ({units.of_stress()})"
        label += "" if unique else "; arbitrary without plastic flow"
        found.append(_on_contact(frames[0], "Contact pressure", pressure, "magma_r", label))
        if middle and largest_dissipation is None and "slip" in frames[-1].at_points:
            found += _friction(frames, units)
    return found


def _friction(frames: Sequence[Surface], units: Units) -> list[Panel]:
    """Return the panels of slip and of friction stress."""
    slip, stress = (
        np.linalg.norm([a.at_points[name] for a in frames], axis=2)
        for name in ("slip", "friction_stress")
    )
    lengths, stresses = units.of_length(), units.of_stress()
    return [
        _on_contact(frames[0], "Slip", slip, "viridis_r", f"magnitude of slip ({lengths})"),
        _on_contact(frames[0], "Friction", stress, "magma_r", f"friction stress ({stresses})"),
    ]


def _on_contact(surface: Surface, title: str, values: Floats, colours: str, label: str) -> Panel:
    """Return a panel with values at points of the contact surfaces, over transparent bodies."""
    panel = _graded(title, values, _from_zero(values), mpl.colormaps[colours], label)
    panel.facets = surface.marks["contact"]
    if not surface.plane:
        panel.title += ", seen through the bodies"
        # In 3D, pressures below this share of the largest pressure are drawn with this opacity.
        # So surfaces that hardly touch each other hide nothing.
        pressed, faint = 0.02, 0.12
        opacity = np.where(values > pressed * values.max(), 1.0, faint)
        panel.colours = np.concatenate([panel.colours, opacity[..., None]], axis=2)
    return panel


def _flow(frames: Sequence[Surface]) -> Panel:
    """Return the panel of the accumulated plastic strain."""
    flow = 100 * np.array([a.at_cells["accumulated_plastic_strain"] for a in frames])
    colours = mpl.colormaps["viridis"]
    return _graded("Accumulated plastic strain", flow, _from_zero(flow), colours, "in %")


def _mechanism(frames: Sequence[Surface], largest_dissipation: float) -> Panel:
    """Return the panel of a mechanism's dissipation, or of its speed if no dissipation is known."""
    if "dissipation" in frames[0].at_cells:
        work = np.array([a.at_cells["dissipation"] for a in frames])
        share = np.divide(work, largest_dissipation or 1.0, dtype=np.float64)
        label = "plastic dissipation, relative to its largest value"
        norm, colours = _logarithmic(share, frames[0].areas), _without_black("CMRmap_r")
        return _graded("Dissipation", share, norm, colours, label)
    speed = np.linalg.norm([a.at_points["displacement"] for a in frames], axis=2)
    share = speed / (speed.max(initial=0.0) or 1.0)
    label = "speed, relative to its largest value"
    return _graded("Velocity", share, Normalize(0, 1), mpl.colormaps["viridis"], label)


def hue(body: int) -> str:
    """Return the colour of a body."""
    return HUES[body % len(HUES)]


def _stress(frames: Sequence[Surface]) -> Panel:
    surface = frames[0]
    ratio = np.array([a.at_cells["yield_ratio"] for a in frames])
    colours = np.zeros((*ratio.shape, 3))
    bars: list[tuple[Colormap, Normalize, str]] = []
    names = surface.names
    groups = [(name, [body]) for body, name in enumerate(names)]
    letters = len(names) * max(map(len, names))
    # If the names have more letters than this, or there are more bodies than hues, one colour
    # serves all bodies.
    most_letters = 40
    if len(names) > len(HUES) or (len(names) > 1 and letters > most_letters):
        groups = [(f"all {len(names)} bodies", list(range(len(names))))]
    # A yield ratio above this limit counts as plastic; the law gives 1 apart from rounding.
    plastic_from = 0.9999
    for label, bodies in groups:
        # elastic stresses have colours from pale to the body's colour; plastic stresses are red
        elastic = [(0.0, "#f6f6f2"), (plastic_from, hue(bodies[0]))]
        stops = [*elastic, (plastic_from, PLASTIC), (1.0, PLASTIC)]
        colormap = LinearSegmentedColormap.from_list("stress", stops, N=20_000)
        own = np.isin(surface.body, bodies)
        colours[:, own] = colormap(ratio[:, own])[..., :3]
        bars.append((colormap, Normalize(0, 100), label))
    return Panel("Stress in % of the yield stress (red: plastic)", colours, bars, loads=True)


def _graded(title: str, values: Floats, norm: Normalize, colours: Colormap, label: str) -> Panel:
    return Panel(title, colours(norm(values))[..., :3], [(colours, norm, label)])


def _without_black(name: str) -> Colormap:
    """Return a colour map without its black end, on which the mesh would be invisible."""
    return LinearSegmentedColormap.from_list(name, mpl.colormaps[name](np.linspace(0, 0.85, 256)))


def _logarithmic(shares: Floats, areas: Floats) -> LogNorm:
    last = shares[-1]
    # The dissipation is infinite at corners. So the range of colours ignores the most dissipating
    # cells up to this share (``singular``) of the area that dissipates more than the share
    # ``dissipates`` of the largest value. It spans ``decades`` powers of ten.
    dissipates, singular, decades = 1e-3, 0.01, 2.0
    order = np.argsort(last)[np.count_nonzero(last < dissipates) :]
    below = np.cumsum(areas[order])
    place = np.searchsorted(below, (1 - singular) * below[-1]) if len(order) else 0
    top = float(last[order[place]]) if len(order) else 1.0
    return LogNorm(top / 10**decades, top, clip=True)


def _from_zero(values: Floats) -> Normalize:
    largest, low = float(values.max(initial=0.0)), float(values.min(initial=0.0))
    below = low if low < -ROUNDING * largest else 0.0
    return Normalize(below, largest if largest > 0 else 1.0)


def compose(
    shown: Sequence[Panel],
    images: Sequence[npt.NDArray[np.uint8]],
    words: tuple[str, str],
    view: View,
    dpi: float = 140,
    curve: Callable[[Axes], None] | None = None,
) -> Figure:
    """Return a figure with words and colour bars around the images of panels.

    Args:
        shown: Panels of the images.
        images: Image of each panel, shape (height, width, 3).
        words: Title and subtitle.
        view: Direction of view.
        dpi: Pixels per inch; the figure is 5.9 inches high.
        curve: Function that draws into an additional last panel.
    """
    columns = len(shown) + (curve is not None)
    figure = Figure(figsize=(5.4 * columns, 5.9), dpi=dpi)
    FigureCanvasAgg(figure)
    figure.suptitle(words[0], fontsize=16, fontweight="bold", y=0.98, parse_math=False)
    caption = figure.text(0.5, 0.89, words[1], ha="center", fontsize=11.5, parse_math=False)
    room, needed = 0.98 * figure.bbox.width, caption.get_window_extent().width
    caption.set_fontsize(11.5 * min(1.0, room / max(needed, 1.0)))
    width = 1 / columns
    for i, panel in enumerate(shown):
        axes = figure.add_axes((i * width, 0.14, width, 0.68))
        axes.imshow(images[i])
        axes.set_axis_off()
        axes.set_title(panel.title, fontsize=12)
        share = 0.8 / len(panel.bars)
        for k, (colours, norm, label) in enumerate(panel.bars):
            left = (i + 0.1 + k * share + 0.03) * width
            ticks = MaxNLocator({1: 6, 2: 4}.get(len(panel.bars), 2))
            bar = Colorbar(
                figure.add_axes((left, 0.12, (share - 0.06) * width, 0.022)),
                cmap=colours,
                norm=norm,
                orientation="horizontal",
                ticks=None if isinstance(norm, LogNorm) else ticks,
                extend="both" if isinstance(norm, LogNorm) else "neither",
            )
            bar.set_label(drawable(label), fontsize=10, parse_math=False)
            bar.ax.tick_params(labelsize=9)
    # the axes are in the corner below the first image, to the left of its colour bar
    draw_axes(figure.add_axes((0.002, 0.0, 0.1 * width, 0.11)), view)
    if curve is not None:
        axes = figure.add_axes((1 - 0.84 * width, 0.14, 0.78 * width, 0.68))
        axes.set_title("Loading", fontsize=12)
        curve(axes)
    return figure


@dataclass(frozen=True)
class Acting:
    """Factors of the loads and obstacles in a state of the bodies.

    Attributes:
        zeta: Load factor.
        factors: Factors of stages by name; empty if there are no stages.
    """

    zeta: float = 0.0
    factors: Mapping[str, float] = field(default_factory=dict)

    def of_load(self, load: Load) -> float:
        """Return the factor of a load; without stages it is 1, or −1 if ζ is negative."""
        if load.constant:
            return 1.0
        if self.factors:
            return self.factors.get(load.name or load.on, 1.0)
        return -1.0 if self.zeta < 0 else 1.0

    def of_obstacle(self, obstacle: Obstacle) -> float:
        """Return the share of its ``move`` by which an obstacle has moved."""
        if not self.factors:
            return self.zeta
        return self.factors.get(obstacle.name or obstacle.on, 0.0)


def acting(reports: Sequence[LevelReport | None]) -> list[Acting]:
    """Return the factors of levels; None stands for the unloaded bodies."""
    names = next((report.factors for report in reports if report), {})
    at_rest = Acting(factors=dict.fromkeys(names, 0.0))
    return [Acting(report.zeta, report.factors) if report else at_rest for report in reports]


def shares(states: Sequence[Acting], loads: Sequence[Load]) -> Floats:
    """Return the factors of each load in all states, relative to the load's largest factor.

    Shape (num_states, num_loads).
    """
    found: Floats = np.array([[state.of_load(load) for load in loads] for state in states])
    largest: Floats = np.abs(found).max(axis=0)
    return np.asarray(found / np.where(largest > 0, largest, 1.0), dtype=np.float64)


Paint = dict[str, Any]
"""Options of pyvista for drawing a mesh."""


DARK = 17
"""Value of red, green and blue in the colour of load arrows."""

IN_FRONT = 1e-3
"""Distance of overlays in front of plane bodies, relative to the size of the bodies."""


class Renderer:
    """The bodies and their surroundings, seen from one direction.

    The frames of an animation differ in deformation, arrows and colours. They share one camera that
    shows all frames completely.

    Attributes:
        view: Direction of view.
    """

    def __init__(
        self,
        frames: Sequence[Surface],
        scene: Scene,
        scale: float,
        pixels: tuple[int, int],
        states: Sequence[Acting] = (Acting(),),
    ) -> None:
        """Build the scene.

        Args:
            frames: One skin in one or more states.
            scene: Surroundings of the bodies.
            scale: Factor of the displacements in the picture.
            pixels: Width and height of each image.
            states: Factors of loads and obstacles in the frames.
        """
        self._skin = skin = frames[-1]
        self._pixels, self._flat, self._size = pixels, skin.plane, skin.size
        self._frames = np.array([a.points + scale * a.at_points["displacement"] for a in frames])
        # Arrows are on the same facets in all frames, so they move with the bodies and do not jump.
        lengths = shares(states, scene.on_surfaces)
        self._arrows = [
            load_arrows(skin, moved, scene.on_surfaces, lengths[number])
            for number, moved in enumerate(self._frames)
        ]
        self.view = view_of(skin, scene.axisymmetric)
        self._axis = _axis(skin) if scene.axisymmetric else None
        bodies = range(len(skin.names))
        self._sharp = [] if self._flat else [self._sharp_edges(body) for body in bodies]
        travels = [
            tuple(
                scale * state.of_obstacle(one) if len(one.move) else 0.0 for one in scene.obstacles
            )
            for state in states
        ]
        parts = {each: self._obstacles_at(scene, each) for each in set(travels)}
        self._obstacles = [parts[each] for each in travels]

    def __repr__(self) -> str:
        return f"Renderer({self._skin!r}, {len(self._frames)} frames)"

    def draw(self, frame: int, panel: Panel) -> npt.NDArray[np.uint8]:
        """Return an image of a panel, shape (height, width, 3)."""
        plotter = pv.Plotter(off_screen=True, window_size=list(self._pixels))
        plotter.set_background("white")
        points, colours = self._frames[frame], panel.colours[frame]
        if panel.facets is None:
            self._add_bodies(plotter, points, colours)
        else:
            self._add_contact(plotter, points, colours, panel.facets)
        for before, after in self._outlines(points):
            plotter.add_mesh(before, color="#b0b0b0", line_width=1.5, lighting=False)
            plotter.add_mesh(after, color="#202020", line_width=2.5, lighting=False)
        for mesh, paint in self._obstacles[frame]:
            plotter.add_mesh(mesh, lighting=not self._flat, **paint)
        plotter.view_vector(self.view.towards, viewup=self.view.up)
        plotter.enable_parallel_projection()
        if self._axis is not None:
            plotter.add_mesh(self._axis, color="#606060", line_width=2, lighting=False)
        shows_loads = panel.loads and len(self._arrows[frame].starts) > 0
        if shows_loads:
            self._add_loads(plotter, frame)
        self._aim(plotter)
        plotter.enable_anti_aliasing("ssaa")
        image = np.asarray(plotter.screenshot(return_img=True))[..., :3]
        if shows_loads:  # hidden loads are faintly visible through the bodies
            plotter.clear_actors()
            self._add_loads(plotter, frame)
            plotter.render()
            alone = np.asarray(plotter.screenshot(return_img=True))[..., :3]
            faint = 0.4
            share = faint * (255.0 - alone) / (255.0 - DARK)
            image = (image - share * np.maximum(image - float(DARK), 0.0)).astype(np.uint8)
        plotter.close()
        return image

    def _add_loads(self, plotter: pv.Plotter, frame: int) -> None:
        arrows = self._arrows[frame]
        plotter.add_arrows(arrows.starts, arrows.vectors, color=(DARK,) * 3, lighting=False)

    def _add_bodies(self, plotter: pv.Plotter, points: Floats, colours: Floats) -> None:
        plotter.add_mesh(
            _mesh(points, self._skin.triangles),
            scalars=colours,
            rgb=True,
            lighting=not self._flat,
            ambient=0.6,
            diffuse=0.45,
            **edges_of_cells(len(self._skin.triangles)),
        )

    def _add_contact(
        self, plotter: pv.Plotter, points: Floats, colours: Floats, chosen: npt.NDArray[np.bool_]
    ) -> None:
        """Add selected facets over transparent bodies: triangles, or thick lines with a rim."""
        skin = self._skin
        # Opacity of plane bodies, and of skins in 3D.
        opacities = {True: 0.2, False: 0.12}
        for body in range(len(skin.names)):
            glass = skin.body == body
            if not self._flat:  # VTK would mix two skins at the same position
                glass &= ~(chosen | skin.marks["opposite"])
            if glass.any():
                mesh = _mesh(points, skin.triangles[glass])
                plotter.add_mesh(
                    mesh, color=hue(body), opacity=opacities[self._flat], lighting=False
                )
        if not self._flat:
            mesh = _mesh(points, skin.facets[chosen])
            plotter.add_mesh(mesh, scalars=colours, rgb=True, lighting=False)
            return
        rim: Paint = {"color": "#404040", "line_width": 30}
        line: Paint = {"scalars": colours, "rgb": True, "line_width": 24}
        for layer, paint in enumerate((rim, line), start=1):
            lifted = points + np.array([0, 0, layer * IN_FRONT * self._size])
            plotter.add_mesh(_mesh(lifted, skin.facets[chosen]), lighting=False, **paint)

    def _obstacles_at(
        self, scene: Scene, travels: Sequence[float]
    ) -> list[tuple[pv.DataSet, Paint]]:
        """Return all obstacles, each displaced by a multiple of its move."""
        near = sample_obstacles(self._skin, self._frames.reshape(-1, 3), scene.obstacles, travels)
        return [
            part
            for distances in near.distances
            for part in self._obstacle(distances, near.corner, near.spacing)
        ]

    def _obstacle(
        self, distances: Floats, corner: Floats, spacing: Floats
    ) -> list[tuple[pv.DataSet, Paint]]:
        """Return the meshes of an obstacle near the bodies, with the options of their drawing."""
        if distances.min() >= 0:
            return []
        grid = pv.ImageData(dimensions=distances.shape, spacing=spacing, origin=corner)
        grid.point_data["distance"] = distances.ravel(order="F")
        # in 3D the surface lies slightly inside the obstacle, because VTK mixes coincident surfaces
        depth = 0.0 if self._flat else IN_FRONT * self._size
        skin = grid.contour([-depth], scalars="distance")
        if not self._flat:
            parts = [(skin, {"color": "#808080", "opacity": 0.25, "smooth_shading": True})]
        else:
            inside = grid.clip_scalar("distance", value=0.0)
            inside.translate((0, 0, -IN_FRONT * self._size), inplace=True)
            across = inside.points[:, :2].sum(axis=1)
            inside.point_data["across"] = across
            hatches = 60  # number of hatching lines across the picture
            step = self._size / hatches
            lines = np.arange(across.min(), across.max() + step, step)
            parts = [
                (inside, {"color": "#eeeeee"}),
                (inside.contour(lines, scalars="across"), {"color": "#b0b0b0", "line_width": 1}),
                (skin, {"color": "#606060", "line_width": 2.5}),
            ]
        return [(mesh, paint) for mesh, paint in parts if mesh.n_points]

    def _aim(self, plotter: pv.Plotter) -> None:
        """Fit all visible objects with their loads into the image, equally in all panels."""
        around = [mesh.points for parts in self._obstacles for mesh, _ in parts]
        arrows = [end for a in self._arrows for end in (a.starts, a.starts + a.vectors)]
        seen = np.concatenate([*self._frames, self._skin.points, *arrows, *around])
        centre, half_height = self.view.fitted(seen, self._pixels)
        plotter.camera.focal_point = centre
        plotter.camera.position = centre + 3 * self._size * self.view.frame[2]
        plotter.camera.parallel_scale = half_height
        plotter.reset_camera_clipping_range()

    def _outlines(self, points: Floats) -> list[tuple[pv.PolyData, pv.PolyData]]:
        """Return the edges of the bodies before and after the deformation."""
        if self._flat:
            return [(_mesh(self._skin.points, self._skin.facets), _mesh(points, self._skin.facets))]
        found = []
        for before in self._sharp:
            after = before.copy()
            after.points = points[before.point_data["number"]]
            found.append((before, after))
        return found

    def _sharp_edges(self, body: int) -> pv.PolyData:
        """Return the sharp edges of an undeformed body."""
        mesh = _mesh(self._skin.points, self._skin.triangles[self._skin.body == body])
        mesh.point_data["number"] = np.arange(len(self._skin.points))
        # Angle (degrees) between facets above which their common edge is drawn. A cylinder with ten
        # facets has no such edges.
        sharp = 40.0
        return mesh.clean().extract_feature_edges(
            sharp, boundary_edges=False, manifold_edges=False, non_manifold_edges=False
        )


def _axis(skin: Surface) -> pv.PolyData:
    """Return the axis of revolution as a dash-dotted line next to the bodies."""
    low, high = skin.points[:, 1].min(), skin.points[:, 1].max()
    # Number of dashes of the axis of revolution, and its extension beyond the bodies, relative to
    # their height.
    dashes, axis_beyond = 24, 0.05
    margin = axis_beyond * (high - low)
    begin = np.linspace(low - margin, high + margin, dashes, endpoint=False)
    dash = begin[1] - begin[0]
    ends = np.column_stack([begin, begin + 0.6 * dash, begin + 0.75 * dash, begin + 0.85 * dash])
    points = np.zeros((ends.size, 3))
    points[:, 1] = ends.ravel()
    points[:, 2] = skin.points[0, 2]
    return _mesh(points, np.arange(len(points)).reshape(-1, 2))


def _mesh(points: Floats, cells: Longs) -> pv.PolyData:
    """Return a mesh of triangles or lines."""
    size = cells.shape[1]
    numbers = np.column_stack([np.full(len(cells), size), cells]).ravel()
    return pv.PolyData(points, faces=numbers) if size == 3 else pv.PolyData(points, lines=numbers)
