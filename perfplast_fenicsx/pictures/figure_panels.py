"""Compose panels of a picture of fields, with the words and colour bars around them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colorbar import Colorbar
from matplotlib.colors import Colormap, LinearSegmentedColormap, LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.pictures.boundary_surface import Surface
from perfplast_fenicsx.pictures.heading import drawable
from perfplast_fenicsx.pictures.views import View, draw_axes
from perfplast_fenicsx.rounding import ROUNDING
from perfplast_fenicsx.units import Units

HUES = ("#6c9bcd", "#b5945c", "#74b386", "#a587c4")
"""Colour of the highest elastic stress, for each body in turn."""


PLASTIC = "#b81414"
"""Colour of plastic cells, darker than the hues, so that it differs from them in grey."""


@dataclass
class Panel:
    """The bodies with one quantity as colour.

    Attributes:
        title: Heading of the panel.
        colours: RGB of each point, or of each triangle, in each frame, shape (num_frames, n, 3);
            with a fourth column for the opacity if the background is visible.
        bars: Colour map, range and label of each colour bar.
        facets: Flags of facets that are coloured, over transparent bodies; None for all triangles.
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
        frames: One skin in one or more states, with the same scales in all frames. They have
            ``displacement``, ``contact_pressure``, ``yield_ratio`` unless bodies are rigid, the
            mark ``contact``, and ``dissipation`` if it is to be shown. ``slip`` and
            ``friction_stress`` are shown beside the displacement. An ``accumulated_plastic_strain``
            is shown instead of the displacement.
        units: Units of the legends.
        largest_dissipation: Largest dissipation of all cells, inner ones too; only for mechanisms.
        middle: Whether to show displacement or dissipation.
        unique: Whether the stress is that of a level. The stress of a limit load is arbitrary where
            nothing flows, which the label of the contact pressure says.
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
        label += "" if unique else "; arbitrary where nothing flows"
        found.append(_on_contact(frames[0], "Contact pressure", pressure, "magma_r", label))
        if middle and largest_dissipation is None and "slip" in frames[-1].at_points:
            found += _friction(frames, units)
    return found


def _friction(frames: Sequence[Surface], units: Units) -> list[Panel]:
    """Return panels of the slip and of the friction stress."""
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
    """Return a panel of values at points of the contact surfaces, over transparent bodies."""
    panel = _graded(title, values, _from_zero(values), mpl.colormaps[colours], label)
    panel.facets = surface.marks["contact"]
    if not surface.plane:
        panel.title += ", seen through the bodies"
        # In space, pressures below this share of the largest one are drawn with this opacity, so
        # that surfaces that hardly touch hide nothing.
        pressed, faint = 0.02, 0.12
        opacity = np.where(values > pressed * values.max(), 1.0, faint)
        panel.colours = np.concatenate([panel.colours, opacity[..., None]], axis=2)
    return panel


def _flow(frames: Sequence[Surface]) -> Panel:
    """Return a panel of the accumulated plastic strain."""
    flow = 100 * np.array([a.at_cells["accumulated_plastic_strain"] for a in frames])
    colours = mpl.colormaps["viridis"]
    return _graded("Accumulated plastic strain", flow, _from_zero(flow), colours, "in %")


def _mechanism(frames: Sequence[Surface], largest_dissipation: float) -> Panel:
    """Return a panel of a mechanism's dissipation, or of the speed if that is not known."""
    if "dissipation" in frames[0].at_cells:
        work = np.array([a.at_cells["dissipation"] for a in frames])
        share = np.divide(work, largest_dissipation or 1.0, dtype=np.float64)
        label = "plastic work of the mechanism, share of its largest"
        norm, colours = _logarithmic(share, frames[0].areas), _without_black("CMRmap_r")
        return _graded("Dissipation", share, norm, colours, label)
    speed = np.linalg.norm([a.at_points["displacement"] for a in frames], axis=2)
    share = speed / (speed.max(initial=0.0) or 1.0)
    label = "speed, share of its largest"
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
    # If names have more letters, or bodies are more than the hues, all bodies have one colour.
    most_letters = 40
    if len(names) > len(HUES) or (len(names) > 1 and letters > most_letters):
        groups = [(f"all {len(names)} bodies", list(range(len(names))))]
    # A yield ratio above this is plastic; the law gives 1 up to rounding.
    plastic_from = 0.9999
    for label, bodies in groups:
        # from pale to the body's colour for elastic stress, then red at once
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
    """Return a colour map that ends in black, cut where the mesh is still visible on it."""
    return LinearSegmentedColormap.from_list(name, mpl.colormaps[name](np.linspace(0, 0.85, 256)))


def _logarithmic(shares: Floats, areas: Floats) -> LogNorm:
    last = shares[-1]
    # The colours of dissipation leave out this share (``singular``) of the area that dissipates
    # more than the share ``dissipates`` of the largest value, which is infinite at corners. They
    # span ``decades`` powers of ten.
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
    """Put words and colour bars around the images of panels.

    Args:
        shown: Panels of the images.
        images: Image of each panel, shape (height, width, 3).
        words: Title and subtitle.
        view: Direction of view.
        dpi: Pixels in 1/5.9 of the figure's height.
        curve: Function that draws into a last panel.
    """
    columns = len(shown) + (curve is not None)
    figure = Figure(figsize=(5.4 * columns, 5.9), dpi=dpi)
    FigureCanvasAgg(figure)
    figure.suptitle(words[0], fontsize=16, fontweight="bold", y=0.98, parse_math=False)
    figure.text(0.5, 0.89, words[1], ha="center", fontsize=11.5, parse_math=False)
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
    # in the corner below the first image, at the left of its colour bar
    draw_axes(figure.add_axes((0.002, 0.0, 0.1 * width, 0.11)), view)
    if curve is not None:
        axes = figure.add_axes((1 - 0.84 * width, 0.14, 0.78 * width, 0.68))
        axes.set_title("Loading", fontsize=12)
        curve(axes)
    return figure
