"""Draw the bodies of a geometry, each in its own colour, with the numbers of their free faces.

Only the drawing process imports this module (:mod:`drawing_process`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from textwrap import wrap
from typing import Any

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
import pyvista as pv
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from scipy.ndimage import distance_transform_edt, find_objects

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.pictures.picture_file import (
    BACK,
    FRONT,
    LEFT,
    PLANE,
    RIGHT,
    View,
    draw_axes,
    in_legend,
    replace_picture,
)

Room = dict[int, tuple[float, float, float]]
"""For each face number: a pixel (x, y) in the face, and its distance from other faces (pixels)."""

ENOUGH = 17.0
"""Least distance (pixels) for which a number is drawn on its face instead of beside it."""


@dataclass(frozen=True)
class Label:
    """A number in a picture.

    Attributes:
        number: Number of a face.
        at: Pixel (x, y) on the face.
        words_at: Pixel at which the number is drawn. If it differs from ``at``, a line connects
            both.
    """

    number: int
    at: tuple[float, float]
    words_at: tuple[float, float]


def rooms(seen: Longs) -> Room:
    """Return for each face the pixel that is farthest from all other faces.

    Args:
        seen: Number of the face visible at each pixel, 0 for no face, shape (height, width).
    """
    found: Room = {}
    for number, part in enumerate(find_objects(seen), start=1):
        if part is None:
            continue
        distance = np.asarray(distance_transform_edt(np.pad(seen[part] == number, 1)))
        ys, xs = np.nonzero(distance >= 0.97 * distance.max())
        from_middle = (ys - ys.mean()) ** 2 + (
            xs - xs.mean()
        ) ** 2  # centres the number on long faces
        y, x = ys[from_middle.argmin()], xs[from_middle.argmin()]
        if distance[y, x] >= 1.5:  # pixels; smaller faces count as invisible
            place = (x + part[1].start - 1, y + part[0].start - 1)
            found[number] = (float(place[0]), float(place[1]), float(distance[y, x]))
    return found


def shared_out(views: Sequence[Room]) -> list[Room]:
    """Return for each view the faces whose numbers it shows.

    A view shows the number of a face if the face has most space in this view, or enough space.

    Args:
        views: Visible faces of each view.
    """
    best = {
        number: max(view[number][2] for view in views if number in view)
        for number in set().union(*views)
    }
    return [
        {n: place for n, place in view.items() if place[2] >= min(best[n], 2 * ENOUGH)}
        for view in views
    ]


def labels(room: Room, pixels: tuple[int, int]) -> list[Label]:
    """Return positions at which the numbers do not overlap, beside their faces if these are small.

    Args:
        room: Space for the number of each face in the view.
        pixels: Width and height of the view.
    """
    size = np.array(pixels)
    taken = [np.array(place[:2]) for place in room.values()]
    found = []
    for number, (x, y, free) in sorted(room.items(), key=lambda item: -item[1][2]):
        at = np.array([x, y])
        words_at = at
        if free < ENOUGH:
            outward = np.arctan2(*(at - size / 2)[::-1])
            turns = np.array([0, 1, -1, 2, -2, 3, -3, 4]) * np.pi / 4
            tried = [
                at + far * np.array([np.cos(outward + turn), np.sin(outward + turn)])
                for far in (34, 52, 76, 104)
                for turn in turns
            ]
            inside = [p for p in tried if (np.minimum(p, size - p) > ENOUGH).all()]
            others = [place for place in taken if (place != at).any()]
            apart = 1.7 * ENOUGH
            words_at = next(
                (p for p in inside if all(np.abs(p - o).max() > apart for o in others)), at
            )
            taken.append(words_at)
        found.append(Label(number, (x, y), (float(words_at[0]), float(words_at[1]))))
    return found


PIXELS, DPI = (1000, 800), 100
"""Size of each view (pixels), and resolution (pixels per inch)."""

Arrays = dict[str, npt.NDArray[np.generic]]


def save_parts(source: str | Path, output: Path) -> None:
    """Draw the skin in an .npz file (:func:`perfplast_fenicsx.geometry.mesher.skin_of`).

    3D bodies are shown from the front and from the back. If these views hide a face, views of both
    sides are added.

    Args:
        source: The file.
        output: A PNG file.
    """
    with np.load(source) as file:
        skin = {name: file[name] for name in file.files}
    if np.ptp(skin["points"][:, 2]) == 0:
        views, hidden = [PLANE], []
        numbers = [_on_curves(skin, PLANE)]
    else:
        views = [FRONT, BACK]
        seen = [rooms(_faces_at_pixels(skin, view)) for view in views]
        if hidden := _hidden(skin, seen):
            views += [LEFT, RIGHT]
            seen += [rooms(_faces_at_pixels(skin, view)) for view in views[2:]]
            hidden = _hidden(skin, seen)
        numbers = [labels(room, PIXELS) for room in shared_out(seen)]
    columns = min(len(views), 2)
    lines = len(views) // columns
    names = [in_legend(str(name)) for name in skin["names"]]
    # largest number of bodies named below the picture, and number of names in a line
    most_names, names_in_line = 24, 6
    handles = [Patch(color=_hue(k), label=name) for k, name in enumerate(names) if k < most_names]
    if len(names) > most_names:
        handles.append(Patch(color="none", label=f"and {len(names) - most_names} more"))
    below = 0.3 + 0.24 * -(-len(handles) // names_in_line)  # inches
    title = title_lines(hidden, columns)
    above, view_height = 0.68 + 0.22 * len(title), 5.6
    height = above + lines * view_height + below
    figure = Figure(figsize=(columns * 7.0, height), dpi=DPI)
    FigureCanvasAgg(figure)
    for place, (view, found) in enumerate(zip(views, numbers, strict=True), start=1):
        axes = figure.add_subplot(lines, columns, place)
        axes.imshow(_image(skin, view))
        axes.set_title(view.words, y=1.0)
        axes.set_axis_off()
        _write(axes, found)
        draw_axes(axes.inset_axes((0.0, 0.88, 0.1, 0.125)), view)
    figure.legend(
        handles=handles,
        loc="lower center",
        ncols=min(names_in_line, len(handles)),
        frameon=False,
    )
    figure.suptitle("\n".join(title), y=1 - 0.2 / height, va="top")
    figure.subplots_adjust(
        *(0.01, below / height, 0.99, 1 - above / height), wspace=0.02, hspace=0.08
    )
    replace_picture(output, figure)


def title_lines(hidden: Sequence[int], columns: int) -> list[str]:
    """Return the lines of the title, which are not wider than the picture.

    Args:
        hidden: Numbers of the faces that no view shows.
        columns: Number of views that are side by side.
    """
    words = "Bodies, and the numbers of their free faces"
    if hidden:
        words += f"; not visible: {', '.join(map(str, sorted(hidden)))}"
    in_view, most = 60, 5  # largest number of characters above a view, and of lines
    return wrap(words, in_view * columns, max_lines=most, placeholder=" ...")


def _write(axes: Axes, found: list[Label]) -> None:
    """Write the numbers on an image."""
    box = {"boxstyle": "round,pad=0.15", "fc": "white", "ec": "#808080", "lw": 0.5, "alpha": 0.85}
    line: dict[str, Any] = {"arrowstyle": "-", "color": "black", "lw": 0.7, "shrinkA": 0}
    for label in found:
        apart = label.at != label.words_at
        axes.annotate(
            str(label.number),
            label.at,
            label.words_at,
            ha="center",
            va="center",
            fontsize=8,
            bbox=box,
            arrowprops=line | {"shrinkB": 0} if apart else None,
        )
        if apart:
            axes.plot(*label.at, "o", color="black", markersize=2.5)


def _hidden(skin: Arrays, seen: list[dict[int, tuple[float, float, float]]]) -> list[int]:
    """Return the numbers of the faces that no view shows."""
    found = set().union(*seen)
    return [int(number) for number in skin["numbers"] if int(number) not in found]


def _on_curves(skin: Arrays, view: View) -> list[Label]:
    """Return labels at the midpoints of the edges of plane bodies."""
    camera = _camera(skin, view)
    places = np.asarray(skin["places"], dtype=np.float64) @ view.frame[:2].T
    pixels = (places - camera.middle) * [1, -1] / camera.pixel + np.array(PIXELS) / 2
    return [
        Label(int(number), (x, y), (x, y))
        for number, (x, y) in zip(skin["numbers"], pixels.tolist(), strict=True)
    ]


def _image(skin: Arrays, view: View) -> npt.NDArray[np.uint8]:
    """Return an image of the bodies from one direction, shape (height, width, 3)."""
    points, triangles = _points(skin), _triangles(skin)
    plotter = _plotter(skin, view)
    flat = view is PLANE
    sharp = 30.0  # angle (degrees) between facets above which an edge is drawn
    for body in range(len(skin["names"])):
        own = triangles[skin["body"] == body]
        if not len(own):  # other bodies cover this body completely
            continue
        mesh = _mesh(points, own).clean()
        plotter.add_mesh(mesh, color=_hue(body), lighting=not flat, ambient=0.5, diffuse=0.5)
        edges = mesh.extract_feature_edges(sharp)
        if edges.n_points:
            plotter.add_mesh(edges, color="#303030", line_width=1.5, lighting=False)
    return _taken(plotter)


def _faces_at_pixels(skin: Arrays, view: View) -> Longs:
    """Return the number of the free face at each pixel, 0 for no face, shape (height, width)."""
    face = np.asarray(skin["face"], dtype=np.int64)
    factor = 0x9E3779B1  # odd factors give unique colours, which differ between neighbours
    colours = face * factor & 0xFFFFFF
    split = (colours[:, None] >> np.array([16, 8, 0]) & 0xFF).astype(np.uint8)
    plotter = _plotter(skin, view)
    mesh = _mesh(_points(skin), _triangles(skin))
    plotter.add_mesh(mesh, scalars=split, rgb=True, lighting=False)
    image = _taken(plotter).astype(np.int64)
    found = image @ np.array([1 << 16, 1 << 8, 1])
    known, first = np.unique(colours, return_index=True)
    at = np.minimum(np.searchsorted(known, found), len(known) - 1)
    return np.where(known[at] == found, face[first][at], 0)


class _Camera:
    """The centre of a view, the limits of the view, and the size of a pixel."""

    def __init__(self, points: Floats, view: View) -> None:
        seen = points @ view.frame.T
        self.low, self.high = seen.min(axis=0), seen.max(axis=0)
        self.middle = (self.low + self.high)[:2] / 2
        margin = 1.06  # size of the view relative to the size of the bodies
        self.pixel = float(margin * np.max((self.high - self.low)[:2] / PIXELS))


def _camera(skin: Arrays, view: View) -> _Camera:
    return _Camera(_points(skin)[np.unique(_triangles(skin))], view)


def _plotter(skin: Arrays, view: View) -> pv.Plotter:
    """Return an empty picture with a camera that shows all bodies."""
    plotter = pv.Plotter(off_screen=True, window_size=list(PIXELS))
    plotter.set_background("white")
    aim = _camera(skin, view)
    depth = float(np.linalg.norm(aim.high - aim.low))
    focus = np.array([*aim.middle, (aim.low[2] + aim.high[2]) / 2]) @ view.frame
    plotter.camera.focal_point = focus
    plotter.camera.position = focus + 2 * depth * view.frame[2]
    plotter.camera.up = view.up
    plotter.camera.clipping_range = (0.5 * depth, 3.5 * depth)
    plotter.enable_parallel_projection()
    plotter.camera.parallel_scale = aim.pixel * PIXELS[1] / 2
    plotter.camera_set = True
    return plotter


def _taken(plotter: pv.Plotter) -> npt.NDArray[np.uint8]:
    image = np.asarray(plotter.screenshot(return_img=True), dtype=np.uint8)
    plotter.close()
    return image[..., :3]


def _points(skin: Arrays) -> Floats:
    return np.asarray(skin["points"], dtype=np.float64)


def _triangles(skin: Arrays) -> Longs:
    return np.asarray(skin["triangles"], dtype=np.int64)


def _mesh(points: Floats, triangles: Longs) -> pv.PolyData:
    return pv.PolyData(points, faces=np.column_stack([np.full(len(triangles), 3), triangles]))


def _hue(body: int) -> str:
    return to_hex(mpl.colormaps["tab20"](body % 20))
