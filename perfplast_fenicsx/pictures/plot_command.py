"""Pictures of results on file, ``perfplast plot`` and ``animate``. Single-process."""

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.pictures.boundary_surface import Surface
from perfplast_fenicsx.pictures.field_figure import (
    deformation_scale,
    draw_panels,
    draw_surface,
    in_words,
    need_matplotlib,
)
from perfplast_fenicsx.pictures.loading_curve import draw_curve, save_curve
from perfplast_fenicsx.pictures.render_process import DrawingError
from perfplast_fenicsx.pictures.result_reader import ResultReader, StoredLevel
from perfplast_fenicsx.pictures.run_figures import level_caption, mechanism_caption

Floats = npt.NDArray[np.float64]

MOST_FRAMES = 60
"""Of more levels as many are shown, the last among them."""

PIXELS, DPI = (700, 560), 80
"""Of a panel of an animation."""

LENGTH, FRAME, END = 8.0, (0.15, 1.0), 2.0
"""An animation takes so long, but each frame between these times, and the last so much more (s)."""

FORMATS = (".gif", ".webp")


def plot(folder: str | Path, output: str | Path | None, say: Callable[[str], None]) -> None:
    """Draw loading curve, plastic zone, mechanism and contact pressure of a run.

    Args:
        folder: Its results; it may still be going on.
        output: Folder for the pictures; by default that of the results.
        say: Called with the path of each picture, and with what cannot be drawn for lack of data.

    Raises:
        InputError: If the folder has no results, nothing can be drawn, or not written.
    """
    archive = ResultReader(folder)
    target = Path(output or folder)
    if not archive.reports:
        raise InputError(f"the run in '{folder}' has solved no level yet; wait for its first one.")
    title, units = archive.model.title, archive.model.units

    def draw(name: str, action: Callable[[Path], None]) -> None:
        with _faults(target / name):
            target.mkdir(parents=True, exist_ok=True)
            action(target / name)
        say(str(target / name))

    levels = archive.levels
    unit = units.of_work(archive.gdim) if levels else ""
    draw("path.png", lambda path: save_curve(archive.reports, title, path, archive.limit, unit))
    if not levels:
        say("The run has written no fields: fields.png and mechanism.png need [output] fields.")
        return
    last = levels[-1]
    surface = archive.surface(last)
    caption = level_caption(last.report.zeta, last.report.alpha, unit)
    draw("fields.png", lambda path: draw_surface(surface, archive.model, caption, path))
    found = _mechanism(archive, levels, surface)
    if found is not None:
        moving, largest, told = found
        draw(
            "mechanism.png",
            lambda path: draw_surface(moving, archive.model, told, path, largest),
        )


def animate(folder: str | Path, output: str | Path | None) -> Path:
    """Show the loading level by level, with the same scales in all frames.

    Args:
        folder: The results of a run; it may still be going on.
        output: A GIF or WebP file; by default ``loading.gif`` in the folder.

    Returns:
        The file.

    Raises:
        InputError: If the folder has no fields, the file cannot be written, or nothing be drawn.
    """
    archive = ResultReader(folder)
    target = Path(output) if output else archive.path / "loading.gif"
    if target.suffix.lower() not in FORMATS:
        raise InputError(
            f"the animation '{target}' ends in '{target.suffix}', which is no format for it; use"
            f" {' or '.join(FORMATS)}."
        )
    levels = archive.levels
    if not levels:
        raise InputError(
            f"the run in '{folder}' has no fields on file; wait for its first level, or run the"
            " case with fields = true under [output]."
        )
    chosen = np.unique(np.linspace(0, len(levels) - 1, min(len(levels), MOST_FRAMES)).round())
    with _faults(target):
        target.parent.mkdir(parents=True, exist_ok=True)
        _animate(archive, [levels[int(i)] for i in chosen], target)
    return target


def _animate(archive: ResultReader, levels: list[StoredLevel], target: Path) -> None:
    need_matplotlib()
    from matplotlib.axes import Axes
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from PIL import Image

    from perfplast_fenicsx.pictures.figure_panels import compose, panels

    model, unit = archive.model, archive.model.units.of_work(archive.gdim)
    surfaces = [archive.surface(level) for level in levels]
    surfaces.insert(0, _unloaded(surfaces[0]))
    path = [(0.0, 0.0), *((level.report.alpha, level.report.zeta) for level in levels)]
    shown = panels(surfaces, model.units, middle=False)
    scale = deformation_scale(surfaces)
    drawn = draw_panels(surfaces, model, shown, scale, PIXELS)
    frames = []
    for number, (alpha, zeta) in enumerate(path):

        def curve(axes: Axes, now: tuple[float, float] = (alpha, zeta)) -> None:
            draw_curve(axes, archive.reports, archive.limit, unit, now)

        words = (model.title, f"{level_caption(zeta, alpha, unit)},   {in_words(scale)}")
        figure = compose(shown, drawn[number], words, DPI, curve)
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        frames.append(Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3]))
    each = float(np.clip(LENGTH / len(frames), *FRAME))
    times = [round(1000 * each)] * (len(frames) - 1) + [round(1000 * (each + END))]
    if target.suffix.lower() == ".gif":
        palette = Image.new("P", (1, 1))
        palette.putpalette(_common_colours([np.asarray(a) for a in frames]).ravel().tolist())
        frames = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    frames[0].save(target, save_all=True, append_images=frames[1:], duration=times, loop=0)


def _common_colours(frames: Sequence[npt.NDArray[np.uint8]]) -> npt.NDArray[np.uint8]:
    """One palette for all frames, so that colours do not flicker, shape (256, 3).

    Each colour counts once however much of the pictures it fills, so that small gradients are
    smooth; white is among them.
    """
    from PIL import Image

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


def _unloaded(surface: Surface) -> Surface:
    """The bodies before the loading."""
    at_points = {name: np.zeros_like(values) for name, values in surface.at_points.items()}
    at_cells = {name: np.zeros_like(values) for name, values in surface.at_cells.items()}
    return dataclasses.replace(surface, at_points=at_points, at_cells=at_cells)


def _mechanism(
    archive: ResultReader, levels: list[StoredLevel], surface: Surface
) -> tuple[Surface, float, str] | None:
    """The mechanism: that of the limit load, else the increment between the last two levels.

    Returns:
        The velocity and stress of the last level, the largest dissipation and a caption; None
        where there is but one level, or no plastic cell.
    """
    found = archive.mechanism(surface)
    if found is not None:
        assert archive.limit is not None
        return *found, mechanism_caption(archive.limit.lower)
    if len(levels) < 2 or levels[-1].report.plastic_cells == 0:
        return None
    before, last = levels[-2:]
    work = last.report.alpha - before.report.alpha
    earlier = archive.surface(before).at_points["displacement"]
    velocity = (surface.at_points["displacement"] - earlier) * (1 / work if work else 1.0)
    at_points = surface.at_points | {"displacement": velocity.astype(np.float64)}
    moving = dataclasses.replace(surface, at_points=at_points)
    zetas = f"ζ = {before.report.zeta:.6g} and {last.report.zeta:.6g}"
    return moving, 0.0, f"velocity between {zetas}, of unit work"


@contextmanager
def _faults(path: Path) -> Iterator[None]:
    """What goes wrong with a picture as a sentence.

    Raises:
        InputError: That says what.
    """
    try:
        yield
    except DrawingError as error:
        raise InputError(f"'{path}' was not drawn: {error}") from error
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError(f"'{path}' cannot be written ({reason}); give another -o.") from error
