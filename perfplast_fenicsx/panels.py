"""What the panels of a picture of fields show, and the words and colour bars around them.

Imported only to draw, since it needs matplotlib.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colorbar import Colorbar
from matplotlib.colors import Colormap, LinearSegmentedColormap, LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from perfplast_fenicsx.surface import Surface

Floats = npt.NDArray[np.float64]

HUES = ("#6c9bcd", "#b5945c", "#74b386", "#a587c4")
"""Colour of the highest elastic stress, for each body in turn."""

PLASTIC = "#b81414"
"""Darker than the hues, so that it can be told from them in grey."""

PLASTIC_FROM = 0.9999
"""A yield ratio above this is plastic; the law gives 1 up to rounding."""

DISSIPATES, SINGULAR, DECADES = 1e-3, 0.01, 2.0
"""The colours of dissipation end where they leave out this share of the area that dissipates more
than so much of the largest: at corners it is infinite. They go so many powers of ten down."""


@dataclass
class Panel:
    """The bodies with one quantity as colour.

    Attributes:
        title: Says what is seen.
        colours: RGB of each point, or of each triangle, shape (n, 3).
        bars: Colour map, range and label of each colour bar.
        facets: Facets that are coloured, over bodies of glass; None for all triangles.
        loads: Draw the loads.
    """

    title: str
    colours: Floats
    bars: list[tuple[Colormap, Normalize, str]]
    facets: npt.NDArray[np.bool_] | None = None
    loads: bool = False


def panels(surface: Surface, largest_dissipation: float) -> list[Panel]:
    """Plastic zone, displacement or dissipation, and contact pressure if any.

    Args:
        surface: With ``displacement``, ``contact_pressure``, ``yield_ratio``, the mark ``contact``,
            and ``dissipation`` where it is to be shown.
        largest_dissipation: Of all cells, inner ones too.
    """
    found = [_stress(surface)]
    if "dissipation" in surface.at_cells:
        work = surface.at_cells["dissipation"]
        share = np.divide(work, largest_dissipation or 1.0, dtype=np.float64)
        label = "plastic work of the mechanism, share of its largest"
        norm, colours = _logarithmic(share, surface.areas), _without_black("CMRmap_r")
        found.append(_graded("Dissipation", share, norm, colours, label))
    else:
        size = np.linalg.norm(surface.at_points["displacement"], axis=1)
        label = "magnitude of u (the mesh's unit of length)"
        found.append(
            _graded("Displacement", size, _from_zero(size), mpl.colormaps["viridis"], label)
        )
    contact = surface.marks["contact"]
    if contact.any():
        pressure = surface.at_points["contact_pressure"]
        label = "pressure (the materials' unit of stress)"
        colours = mpl.colormaps["magma_r"]
        panel = _graded("Contact pressure", pressure, _from_zero(pressure), colours, label)
        panel.facets = contact
        panel.title += "" if surface.plane else ", seen through the bodies"
        found.append(panel)
    return found


def hue(body: int) -> str:
    """Colour of a body."""
    return HUES[body % len(HUES)]


def _stress(surface: Surface) -> Panel:
    ratio = surface.at_cells["yield_ratio"]
    colours = np.zeros((len(ratio), 3))
    bars: list[tuple[Colormap, Normalize, str]] = []
    for body, name in enumerate(surface.names):
        # pale to the body's colour for elastic stress, then red at once
        elastic = [(0.0, "#f6f6f2"), (PLASTIC_FROM, hue(body))]
        stops = [*elastic, (PLASTIC_FROM, PLASTIC), (1.0, PLASTIC)]
        colormap = LinearSegmentedColormap.from_list("stress", stops, N=20_000)
        own = surface.body == body
        colours[own] = colormap(ratio[own])[:, :3]
        bars.append((colormap, Normalize(0, 100), name))
    return Panel("Stress in % of the yield stress (red: plastic)", colours, bars, loads=True)


def _graded(title: str, values: Floats, norm: Normalize, colours: Colormap, label: str) -> Panel:
    return Panel(title, colours(norm(values))[:, :3], [(colours, norm, label)])


def _without_black(name: str) -> Colormap:
    """A colour map that ends in black, up to where the mesh is still seen on it."""
    return LinearSegmentedColormap.from_list(name, mpl.colormaps[name](np.linspace(0, 0.85, 256)))


def _logarithmic(shares: Floats, areas: Floats) -> LogNorm:
    order = np.argsort(shares)[np.count_nonzero(shares < DISSIPATES) :]
    below = np.cumsum(areas[order])
    place = np.searchsorted(below, (1 - SINGULAR) * below[-1]) if len(order) else 0
    top = float(shares[order[place]]) if len(order) else 1.0
    return LogNorm(top / 10**DECADES, top, clip=True)


def _from_zero(values: Floats) -> Normalize:
    largest = float(values.max(initial=0.0))
    return Normalize(min(0.0, float(values.min(initial=0.0))), largest if largest > 0 else 1.0)


def compose(
    shown: Sequence[Panel],
    images: npt.NDArray[np.uint8],
    title: str,
    subtitle: str,
    path: Path,
) -> None:
    """Put words and colour bars around the images of panels, and save the picture."""
    figure = Figure(figsize=(5.4 * len(shown), 5.9), dpi=140)
    FigureCanvasAgg(figure)
    figure.suptitle(title, fontsize=16, fontweight="bold", y=0.98, parse_math=False)
    figure.text(0.5, 0.89, subtitle, ha="center", fontsize=11.5, parse_math=False)
    width = 1 / len(shown)
    for i, panel in enumerate(shown):
        axes = figure.add_axes((i * width, 0.14, width, 0.68))
        axes.imshow(images[i])
        axes.set_axis_off()
        axes.set_title(panel.title, fontsize=12)
        share = 0.8 / len(panel.bars)
        for k, (colours, norm, label) in enumerate(panel.bars):
            left = (i + 0.1 + k * share + 0.03) * width
            ticks = MaxNLocator(4 if len(panel.bars) > 1 else 6)
            bar = Colorbar(
                figure.add_axes((left, 0.12, (share - 0.06) * width, 0.022)),
                cmap=colours,
                norm=norm,
                orientation="horizontal",
                ticks=None if isinstance(norm, LogNorm) else ticks,
                extend="both" if isinstance(norm, LogNorm) else "neither",
            )
            bar.set_label(label, fontsize=10, parse_math=False)
            bar.ax.tick_params(labelsize=9)
    figure.savefig(path)
