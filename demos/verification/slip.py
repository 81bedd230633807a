"""Draw a collapse mechanism in plane strain with the exact slip lines."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from perfplast_fenicsx.io import ResultFolder
from perfplast_fenicsx.pictures import ResultReader

Line = Sequence[tuple[float, float]]
"""Points (x, y) of a slip line."""

SHARPEST = 0.2
"""Fraction of the plastic work that is in the cells with the darkest colour."""

MARGIN = 0.25
"""Margin around the exact slip lines, relative to the size of their bounding box."""


def prandtl_lines(down: bool) -> list[Line]:
    """Return slip lines of Prandtl's solution on one side of the line 0 ≤ x ≤ 1, y = 0.

    Args:
        down: Whether the body lies below the line; otherwise it lies above.
    """
    sign, radius = -1.0 if down else 1.0, math.sqrt(2)
    angles = np.linspace(3, 1, 31) * math.pi / 4
    arc = [(1 + radius * math.cos(t), sign * radius * math.sin(t)) for t in angles]
    edge = (1.0, 0.0)
    return [[*arc, (3.0, 0.0)], [arc[0], edge], [edge, arc[-1]]]


def subfolder(folder: ResultFolder, name: str) -> ResultFolder:
    """Return a subfolder for the pictures of one case. Collective."""
    inside = ResultFolder(folder.comm, folder.file(name), force=True)
    inside.create()
    return inside


def draw_slip(folder: ResultFolder, title: str, exact: Sequence[Line] = ()) -> None:
    """Draw ``slip.png`` with the plastic dissipation of a mechanism and exact slip lines.

    Collective.

    Args:
        folder: Results of a plane problem with a limit load; the picture is written into this
        folder.
        title: Title of the picture.
        exact: Slip lines of the exact solution; the picture shows their neighbourhood.
    """
    folder.on_root(lambda: _draw(folder.path, title, exact))


def _draw(folder: Path, title: str, exact: Sequence[Line]) -> None:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    reader = ResultReader(folder)
    found = reader.mechanism(reader.surface(reader.levels[-1]) if reader.levels else None)
    assert found is not None, f"there is no mechanism in {folder}"
    surface, _ = found
    x, y = surface.points[:, 0], surface.points[:, 1]
    rate = surface.at_cells["dissipation"]
    order = np.argsort(-rate)
    work = np.cumsum((rate * surface.areas)[order])
    shown = rate / rate[order[np.searchsorted(work, SHARPEST * work[-1])]]

    figure = Figure(figsize=(8, 6), dpi=130, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot(aspect="equal")
    image = axes.tripcolor(x, y, surface.triangles, facecolors=shown, cmap="Reds", vmin=0, vmax=1)
    image.set(edgecolor="#dccfca", linewidth=0.3, antialiased=True)
    for a, b in surface.edges:
        axes.plot(x[[a, b]], y[[a, b]], color="black", linewidth=1.0)
    for number, line in enumerate(exact):
        label = "slip lines of the exact solution" if number == 0 else None
        axes.plot(*zip(*line, strict=True), "--", color="#1f5fa8", linewidth=1.8, label=label)
    if exact:
        points = np.concatenate([np.asarray(line) for line in exact])
        low, high = points.min(axis=0), points.max(axis=0)
        margin = MARGIN * float((high - low).max())
        lowest = np.maximum(low - margin, [x.min(), y.min()]) - margin / 8
        highest = np.minimum(high + margin, [x.max(), y.max()]) + margin / 8
        axes.set(xlim=(lowest[0], highest[0]), ylim=(lowest[1], highest[1]))
        figure.legend(loc="outside lower center")
    axes.set(xlabel="x", ylabel="y")
    figure.suptitle(f"{title}: where the mechanism slips")
    label = "plastic work of the mechanism, relative"
    figure.colorbar(image, label=label, extend="max", shrink=0.7)
    figure.savefig(folder / "slip.png", bbox_inches="tight")
