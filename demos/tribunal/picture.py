"""Draw a small picture of a problem: the bodies, and the part that moves at collapse."""

from pathlib import Path

import h5py
import numpy as np
import numpy.typing as npt
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from PIL import Image

WIDTH, HEIGHT = 160, 64
"""Largest size of a picture (pixels)."""

EDGE = 2
"""Width of the empty margin (pixels)."""

COLOURS = np.array(
    [[225, 225, 225], [250, 218, 140], [246, 168, 80], [226, 106, 44], [172, 42, 24]]
)
"""Colours of parts at rest, and of parts with increasing speed."""

SPEEDS = (0.02, 0.25, 0.5, 0.75)
"""Fractions of the largest speed at which the colour changes."""

SLOW = 0.99
"""Fraction of the moving area that determines the largest speed: a few cells in corners are much
faster."""


ENOUGH = 100.0
"""Smallest area of the moving part (pixels) in a picture of all bodies."""


def draw(proof: Path, picture: Path) -> None:
    """Draw the bodies of an upper bound, with the speed of its mechanism, as a PNG file.

    Lines show the outer boundary, and the boundaries between different strengths.

    Args:
        proof: A file with an upper bound in the plane, such as ``falls.h5`` or ``bounds.h5``.
        picture: The PNG file.
    """
    with h5py.File(proof) as file:
        half = file["upper"]
        cells, vertices, cone = (half[name][()] for name in ("cells", "vertices", "cone"))
        speed = np.linalg.norm(half["velocity"][()][half["nodes"][()][:, :3]], axis=2).mean(axis=1)
    corners = vertices[cells]
    sides = corners[:, 1:] - corners[:, :1]
    area = np.abs(sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0])
    level = np.searchsorted(SPEEDS, speed / _fast(speed, area))
    moving = level > 0
    low, high = _window(corners, area / 2, moving)
    size, scale = high - low, _scale(high - low)
    pixels = np.ceil(scale * size) + 2 * EDGE
    figure = Figure(figsize=(float(pixels[0]) / 100, float(pixels[1]) / 100), dpi=100)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.axis("off")
    axes.set(xlim=(0, pixels[0]), ylim=(0, pixels[1]))
    place = scale * (corners - low) + EDGE
    fill = COLOURS[level] / 255
    axes.add_collection(PolyCollection(list(place), facecolor=fill, edgecolor=fill, lw=0.3))
    lines = scale * (vertices[_outlines(cells, cone)] - low) + EDGE
    axes.add_collection(LineCollection(list(lines), color="black", lw=0.6))
    if (low > corners.min(axis=(0, 1))).any() or (high < corners.max(axis=(0, 1))).any():
        above = fill[moving]  # in details, where the moving part may be as thin as a line
        style = {"facecolor": above, "edgecolor": above, "lw": 0.3, "zorder": 3}
        axes.add_collection(PolyCollection(list(place[moving]), **style))
    for drawn in axes.collections:
        drawn.set_antialiased(False)
    new = picture.with_suffix(".new.png")
    figure.savefig(new)
    with Image.open(new) as image:
        few = image.convert("RGB").quantize(colors=len(COLOURS) + 2, dither=Image.Dither.NONE)
    few.save(picture, optimize=True)
    new.unlink()


def _scale(size: npt.NDArray[np.float64]) -> float:
    """Return the number of pixels per length with which a window of this size fills a picture."""
    return float(min((WIDTH - 2 * EDGE) / size[0], (HEIGHT - 2 * EDGE) / size[1]))


def _window(
    corners: npt.NDArray[np.float64],
    area: npt.NDArray[np.float64],
    moving: npt.NDArray[np.bool_],
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Return the corners of the part that the picture shows, the lower left one first.

    The picture shows the bodies, or only the surroundings of the moving part if this part would
    otherwise disappear below the lines.
    """
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    if not moving.any() or area[moving].sum() * _scale(high - low) ** 2 >= ENOUGH:
        return low, high
    first, last = (of(corners[moving], axis=(0, 1)) for of in (np.min, np.max))
    around = 0.25 * float((last - first).max())
    return np.maximum(low, first - around), np.minimum(high, last + around)


def _fast(speed: npt.NDArray[np.float64], area: npt.NDArray[np.float64]) -> float:
    """Return a speed that only a small fraction of the moving area exceeds."""
    order = np.argsort(speed)
    moving = np.cumsum((area * speed)[order])
    return float(speed[order][np.searchsorted(moving, SLOW * moving[-1])])


def _outlines(cells: npt.NDArray[np.int64], cone: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Return the edges of only one cell, and edges between different strengths, shape (n, 2)."""
    edges = np.sort(cells[:, [[1, 2], [0, 2], [0, 1]]].reshape(-1, 2), axis=1)
    strength = np.repeat(cone, 3)
    found, first, place, count = np.unique(
        edges, axis=0, return_index=True, return_inverse=True, return_counts=True
    )
    other = np.zeros(len(found), dtype=np.bool_)
    np.logical_or.at(other, place.ravel(), strength != strength[first][place.ravel()])
    return found[(count == 1) | other]
