"""Animate the loading: plastic zone, contact pressure and loading curve, level by level."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from PIL import Image

from perfplast_fenicsx.pictures.boundary_surface import Surface
from perfplast_fenicsx.pictures.field_figure import deformation_scale, in_words, level_caption
from perfplast_fenicsx.pictures.loading_curve import draw_curve, draw_stroke
from perfplast_fenicsx.pictures.picture_file import heading
from perfplast_fenicsx.pictures.renderer import Renderer, acting, compose, panels
from perfplast_fenicsx.pictures.result_reader import ResultReader, StoredLevel
from perfplast_fenicsx.problem.judged.report import LevelReport

LENGTH, FRAME, END = 8.0, (0.15, 1.0), 2.0
"""Duration of an animation (s), least and largest duration of a frame (s), and additional time of
the last frame (s).
"""


def save_animation(reader: ResultReader, levels: Sequence[StoredLevel], target: Path) -> None:
    """Draw the loading from the unloaded bodies on, with the same scales in all frames.

    Args:
        reader: Reader of the results.
        levels: Levels with fields.
        target: A GIF or WebP file.

    Raises:
        OSError: If the file cannot be written.
    """
    most_frames = 60  # largest number of levels that are shown; the last level is always shown
    chosen = np.unique(np.linspace(0, len(levels) - 1, min(len(levels), most_frames)).round())
    levels = [levels[int(i)] for i in chosen]
    scene, unit = reader.scene, reader.scene.unit_of_work(reader.gdim)
    surfaces = [reader.surface(level) for level in levels]
    surfaces.insert(0, _unloaded(surfaces[0]))
    path = [None, *(level.report for level in levels)]
    shown = panels(surfaces, scene.units, middle=False)
    scale = deformation_scale(surfaces)
    pixels, dpi = (700, 560), 80  # size and resolution of each panel
    renderer = Renderer(surfaces, scene, scale, pixels, acting(path))
    frames = []
    for number, report in enumerate(path):

        def curve(axes: Axes, report: LevelReport | None = report) -> None:
            if scene.driven:
                now = (report.zeta, report.driving_force) if report else (0.0, 0.0)
                draw_stroke(axes, reader.reports, unit, now)
            else:
                draw_curve(axes, reader.reports, reader.limit, unit, report)

        images = [renderer.draw(number, panel) for panel in shown]
        state = level_caption(report, scene.driven, unit)
        words = (heading(scene.title), f"{state},   {in_words(scale)}{scene.view}")
        canvas = FigureCanvasAgg(compose(shown, images, words, renderer.view, dpi, curve))
        canvas.draw()
        frames.append(Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3]))
    each = float(np.clip(LENGTH / len(frames), *FRAME))
    times = [round(1000 * each)] * (len(frames) - 1) + [round(1000 * (each + END))]
    if target.suffix.lower() == ".gif":
        palette = Image.new("P", (1, 1))
        palette.putpalette(_common_colours([np.asarray(a) for a in frames]).ravel().tolist())
        frames = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    frames[0].save(target, save_all=True, append_images=frames[1:], duration=times, loop=0)


def _unloaded(surface: Surface) -> Surface:
    """Return the skin of the bodies before loading, with all fields zero."""
    at_points = {name: np.zeros_like(values) for name, values in surface.at_points.items()}
    at_cells = {name: np.zeros_like(values) for name, values in surface.at_cells.items()}
    return dataclasses.replace(surface, at_points=at_points, at_cells=at_cells)


def _common_colours(frames: Sequence[npt.NDArray[np.uint8]]) -> npt.NDArray[np.uint8]:
    """Return one palette for all frames, shape (256, 3), so that colours do not flicker.

    Each colour counts once, whatever area it covers, which gives smooth colour gradients in small
    areas. The palette contains white.
    """
    found: npt.NDArray[np.uint32] = np.zeros(0, dtype=np.uint32)
    for frame in frames:
        red, green, blue = (frame[..., i].astype(np.uint32) & 0xFC for i in range(3))
        found = np.union1d(found, red << 16 | green << 8 | blue)
    different = found[:, None] >> np.array([16, 8, 0], dtype=np.uint32) & 0xFF
    sample = Image.fromarray(different.astype(np.uint8)[None])
    palette = sample.quantize(255, Image.Quantize.MEDIANCUT, kmeans=2).getpalette() or []
    colours = np.full((256, 3), 255, dtype=np.uint8)
    colours[: min(len(palette) // 3, 255)] = np.reshape(palette, (-1, 3))[:255]
    return colours
