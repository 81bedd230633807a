"""A picture of the bodies of a geometry, each in its colour, with the numbers of their free faces.

Only the drawing process imports this (:mod:`drawing_process`).
"""

from pathlib import Path

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
import pyvista as pv
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from perfplast_fenicsx.arrays import Floats

PIXELS, DPI = (1000, 800), 100
"""Of each view."""


def save_parts(source: str | Path, output: Path) -> None:
    """Draw the skin in an .npz file (:func:`perfplast_fenicsx.geometry.skin.skin_of`).

    Args:
        source: The file.
        output: A PNG file.
    """
    with np.load(source) as file:
        skin = {name: file[name] for name in file.files}
    flat = np.ptp(skin["points"][:, 2]) == 0
    # Directions from which bodies in space are seen.
    directions = {"from the front": (1.0, -1.6, 0.9), "from behind": (-1.0, 1.6, -0.9)}
    views = {"": (0.0, 0.0, 1.0)} if flat else directions
    figure = Figure(figsize=(len(views) * 7.0, 6.4), dpi=DPI)
    FigureCanvasAgg(figure)
    for column, (words, view) in enumerate(views.items(), start=1):
        axes = figure.add_subplot(1, len(views), column)
        axes.imshow(_view(skin, np.array(view), flat))
        axes.set_title(words)
        axes.set_axis_off()
    names = [str(name) for name in skin["names"]]
    most_names = 24  # so many bodies are named beside the picture at most
    handles = [Patch(color=_hue(k), label=name) for k, name in enumerate(names) if k < most_names]
    if len(names) > most_names:
        handles.append(Patch(color="none", label=f"and {len(names) - most_names} more"))
    columns = 6  # columns of the names of bodies
    figure.legend(
        handles=handles, loc="lower center", ncols=min(columns, len(handles)), frameon=False
    )
    figure.suptitle("Bodies, and the numbers of their free faces")
    rows = -(-len(handles) // columns)
    figure.subplots_adjust(0.01, 0.03 + 0.037 * rows, 0.99, 0.9, wspace=0.02)
    figure.savefig(output)


def _view(
    skin: dict[str, npt.NDArray[np.generic]], view: Floats, flat: bool
) -> npt.NDArray[np.uint8]:
    """An image of the bodies from one direction."""
    points, triangles = np.asarray(skin["points"], dtype=np.float64), skin["triangles"]
    plotter = pv.Plotter(off_screen=True, window_size=list(PIXELS))
    plotter.set_background("white")
    sharp = 30.0  # edges between facets that differ by more degrees are drawn
    for body in range(len(skin["names"])):
        own = np.asarray(triangles[skin["body"] == body], dtype=np.int64)
        if not len(own):  # others cover all of it
            continue
        faces = np.column_stack([np.full(len(own), 3), own]).ravel()
        mesh = pv.PolyData(points, faces=faces).clean()
        plotter.add_mesh(mesh, color=_hue(body), lighting=not flat, ambient=0.5, diffuse=0.5)
        edges = mesh.extract_feature_edges(sharp)
        if edges.n_points:
            plotter.add_mesh(edges, color="#303030", line_width=1.5, lighting=False)
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    places = np.asarray(skin["places"], dtype=np.float64)
    lifted = 0.004  # numbers stand so far before their faces, relative to the size of all
    plotter.add_point_labels(
        places + lifted * size * view / np.linalg.norm(view),
        [str(number) for number in skin["numbers"]],
        font_size=15,
        text_color="black",
        shape_color="white",
        shape_opacity=0.75,
        show_points=False,
        always_visible=flat,
    )
    up = (0.0, 1.0, 0.0) if flat else (0.0, 0.0, 1.0)
    plotter.view_vector(view, viewup=up)
    plotter.enable_parallel_projection()
    plotter.reset_camera()
    _fit(plotter.camera, points[np.unique(triangles)], view, np.array(up))
    plotter.reset_camera_clipping_range()
    if not flat:
        plotter.add_axes()
    image = np.asarray(plotter.screenshot(return_img=True), dtype=np.uint8)
    plotter.close()
    return image


def _fit(camera: pv.Camera, points: Floats, view: Floats, up: Floats) -> None:
    """Let a parallel projection show all points, and little else."""
    towards = view / np.linalg.norm(view)
    right = np.cross(up, towards)
    axes = np.array([right / np.linalg.norm(right), np.cross(towards, right)])
    axes[1] /= np.linalg.norm(axes[1])
    seen = points @ axes.T
    low, high = seen.min(axis=0), seen.max(axis=0)
    focus = np.array(camera.focal_point)
    shift = ((low + high) / 2 - axes @ focus) @ axes
    camera.focal_point, camera.position = focus + shift, np.array(camera.position) + shift
    width, height = high - low
    margin = 1.06  # so much more than the bodies is seen
    camera.parallel_scale = margin / 2 * max(height, width * PIXELS[1] / PIXELS[0])


def _hue(body: int) -> str:
    return to_hex(mpl.colormaps["tab20"](body % 20))
