"""Draw the pictures of a result folder (:mod:`perfplast_fenicsx.io.results.result_files`).

Modules that need matplotlib or VTK are imported on use. So the loading curve needs no VTK, and an
error message can name a missing package.
"""

import dataclasses
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.io.results.result_files import Drawing, figures
from perfplast_fenicsx.outcome_words import MeshEstimate
from perfplast_fenicsx.pictures.boundary_surface import Surface
from perfplast_fenicsx.pictures.result_reader import ResultReader, StoredLimit
from perfplast_fenicsx.rounding import rounded_down, rounded_up


def plot(folder: str | Path, output: str | Path | None = None) -> Iterator[str]:
    """Draw the :func:`~perfplast_fenicsx.io.results.result_files.figures` of a run.

    Args:
        folder: The result folder of the run, which may still be in progress.
        output: Folder for the pictures; the result folder by default.

    Yields:
        The path of each picture after it is drawn, and a sentence for each picture whose data are
        missing.

    Raises:
        InputError: If the folder has no results, or if nothing can be drawn or written.
    """
    reader, target = ResultReader(folder), Path(output or folder)
    if not reader.reports and reader.limit is None:
        raise InputError(
            f"the run in '{folder}' has solved no level yet; wait for its first level."
        )
    for figure in figures():
        with _drawing(target / figure.file) as path:
            draw = figure.of(reader)
            said = draw(path) if callable(draw) else draw
        if callable(draw):
            yield str(path)
        if said is not None:
            yield said


def path(reader: ResultReader) -> Drawing | None:
    """Return a function that draws ``path.png``: load factor and work of all levels."""
    if not reader.reports:
        return None

    def draw(picture: Path) -> str | None:
        from perfplast_fenicsx.pictures.loading_curve import save_curve
        from perfplast_fenicsx.pictures.picture_file import heading, remark_on

        scene = reader.scene
        unit = scene.unit_of_work(reader.gdim) if reader.levels else ""
        title = heading(scene.title)
        save_curve(reader.reports, title, picture, reader.limit, unit, scene.driven)
        return remark_on(scene.title)

    return draw


def seepage(reader: ResultReader) -> Drawing | str | None:
    """Return a function that draws ``seepage.png``: heads and flow lines in the plane."""
    flow = reader.flow
    if flow is None:
        return None
    if flow.points.shape[1] == 3:
        return "Water flow in 3D is not drawn; open seepage.vtkhdf in ParaView."

    def draw(picture: Path) -> str | None:
        from perfplast_fenicsx.pictures.flow_figure import save_flow
        from perfplast_fenicsx.pictures.picture_file import heading, remark_on

        save_flow(flow, heading(reader.scene.title), reader.summary.units, picture)
        return remark_on(reader.scene.title)

    return draw


def fields(reader: ResultReader) -> Drawing | str | None:
    """Return a function that draws ``fields.png``: the bodies after the last level."""
    if not reader.reports:
        return None
    if not any(report.converged for report in reader.reports):
        return "No level is solved: there are no fields to draw."
    if not reader.levels:
        return "The run has written no fields: fields.png and mechanism.png need [output] fields."

    def draw(picture: Path) -> None:
        from perfplast_fenicsx.pictures.field_figure import draw_fields, level_caption
        from perfplast_fenicsx.pictures.renderer import acting

        scene, report = reader.scene, reader.levels[-1].report
        caption = level_caption(report, scene.driven, scene.unit_of_work(reader.gdim))
        draw_fields(_last(reader), scene, caption, picture, state=acting([report])[0])

    return draw


def strength(reader: ResultReader) -> Drawing | None:
    """Return a function that draws ``strength.png``: load factors over the divisor of strengths."""
    table = _asked(reader, "strength")
    if not table:
        return None

    def draw(picture: Path) -> None:
        from perfplast_fenicsx.pictures.envelope_picture import save_strength

        save_strength(table, reader.scene.title, picture)

    return draw


def envelope(reader: ResultReader) -> Drawing | None:
    """Return a function that draws ``envelope.png``: the carried combinations of loads."""
    pairs = _asked(reader, "envelope")
    if not pairs:
        return None

    def draw(picture: Path) -> None:
        from perfplast_fenicsx.pictures.envelope_picture import save_envelope

        alone = not any(load.constant for load in reader.scene.loads)
        save_envelope(pairs["rows"], pairs["names"], reader.scene.title, picture, alone)

    return draw


def shakedown(reader: ResultReader) -> Drawing | None:
    """Return a function that draws ``shakedown.png``: shakedown loads for each ratio of loads."""
    table = _asked(reader, "shakedown")
    if not table or not table["diagram"]:
        return None

    def draw(picture: Path) -> None:
        from perfplast_fenicsx.pictures.envelope_picture import save_shakedown

        save_shakedown(table["diagram"], table["names"], reader.scene.title, picture)

    return draw


def mechanism(reader: ResultReader) -> Drawing | str | None:
    """Return a function that draws ``mechanism.png``: the bodies as they collapse."""
    surface = _last(reader) if reader.levels else None
    found = _mechanism(reader, surface) if surface or not reader.reports else None
    if found is None:
        if reader.reports:
            return None
        return "There is no mechanism to draw: it needs a limit load and [output] fields."
    moving, largest, caption = found

    def draw(picture: Path) -> None:
        from perfplast_fenicsx.pictures.field_figure import draw_fields

        unique = surface is not None
        draw_fields(moving, reader.scene, caption, picture, largest, unique=unique)

    return draw


def _asked(reader: ResultReader, what: str) -> Mapping[str, Any] | None:
    """Return a table in the limit load of a run without levels; None if it has no such table."""
    table: Mapping[str, Any] | None = None
    if reader.limit is not None and not reader.reports:
        table = getattr(reader.limit, what)
    return table


@lru_cache(maxsize=1)
def _last(reader: ResultReader) -> Surface:
    """Return the skin at the last level that has fields."""
    return reader.surface(reader.levels[-1])


def animate(folder: str | Path, output: str | Path | None = None) -> Iterator[str]:
    """Animate the loading level by level, with the same scales in all frames.

    Args:
        folder: The result folder of a run, which may still be in progress.
        output: A GIF or WebP file; ``loading.gif`` in the folder by default.

    Yields:
        The path of the file after it is drawn.

    Raises:
        InputError: If the folder has no fields, or if nothing can be drawn or written.
    """
    reader = ResultReader(folder)
    target = Path(output) if output else reader.path / "loading.gif"
    formats = (".gif", ".webp")  # supported formats of animations
    if target.suffix.lower() not in formats:
        raise InputError(
            f"the format of the animation '{target}' is not supported; use {' or '.join(formats)}."
        )
    levels = reader.levels
    if not levels:
        raise InputError(
            f"the run in '{folder}' has stored no fields; wait for its first level, or run the"
            " case with fields = true under [output]."
        )
    with _drawing(target) as path:
        from perfplast_fenicsx.pictures.animation import save_animation

        save_animation(reader, levels, path)
    yield str(path)


def parts(skin: str | Path, output: str | Path) -> Iterator[str]:
    """Draw the bodies of a geometry, with the numbers of their free faces.

    Args:
        skin: An .npz file of :func:`perfplast_fenicsx.geometry.mesher.skin_of`.
        output: A PNG file.

    Yields:
        The path of the picture after it is drawn.

    Raises:
        InputError: If the picture cannot be drawn or written.
    """
    with _drawing(Path(output)) as path:
        from perfplast_fenicsx.pictures.parts_figure import save_parts

        save_parts(skin, path)
    yield str(path)


def draw_case(arrays: Mapping[str, npt.NDArray[Any]], output: Path) -> None:
    """Draw a case before the run: loaded, held, touching and free surfaces.

    Args:
        arrays: The :func:`perfplast_fenicsx.cli.case_picture.arrays_of` a case.
        output: A PNG file.

    Raises:
        InputError: If the picture cannot be drawn or written.
    """
    with _drawing(output) as path:
        from perfplast_fenicsx.pictures.case_figure import save_case

        save_case(arrays, path)


def case(source: str | Path, output: str | Path) -> Iterator[str]:
    """Draw a case (:func:`draw_case`) from a file.

    Args:
        source: An .npz file of the arrays.
        output: A PNG file.

    Yields:
        The path of the picture after it is drawn.

    Raises:
        InputError: If the picture cannot be drawn or written.
    """
    with np.load(source) as file:
        draw_case(dict(file), Path(output))
    yield str(output)


def _mechanism(reader: ResultReader, surface: Surface | None) -> tuple[Surface, float, str] | None:
    """Return the mechanism at the limit load, or else the last increment between levels.

    Args:
        reader: The results.
        surface: The last level, if there is any.

    Returns:
        The velocity with a stress (of the last level, or of the mechanism), the largest
        dissipation, and a caption. None if there is neither a mechanism nor a path with two levels
        and plastic cells, or if the case has stages.
    """
    found = reader.mechanism(surface)
    if found is not None:
        assert reader.limit is not None
        return *found, _collapse(reader.limit)
    levels = reader.levels
    if surface is None or len(levels) < 2 or levels[-1].report.plastic_cells == 0:
        return None
    if levels[-1].report.factors:
        return None  # the levels of a history need not be near collapse
    before, last = levels[-2:]
    work = last.report.alpha - before.report.alpha
    earlier = reader.surface(before).at_points["displacement"]
    velocity = (surface.at_points["displacement"] - earlier) * (1 / work if work else 1.0)
    moving = dataclasses.replace(surface, at_points=surface.at_points | {"displacement": velocity})
    zetas = f"ζ = {before.report.zeta:.6g} and {last.report.zeta:.6g}"
    return moving, 0.0, f"velocity between {zetas}, of unit work"


def _collapse(limit: StoredLimit) -> str:
    """Return a caption of the mechanism, with the limit load of the bodies or of the mesh."""
    if not limit.theorem:
        return f"velocity at the end of this path, ζ = {rounded_down(limit.lower)}"
    if limit.strength:
        factor = limit.strength["upper"]
        reduced = "" if factor is None else f", strengths divided by F = {rounded_up(factor)}"
        return f"collapse mechanism of the constant loads{reduced}"
    if limit.envelope:
        last = ", ".join(f"{angle:.4g}°" for angle in limit.envelope["directions"][-1])
        return f"collapse mechanism in the last direction, {last}"
    if limit.shakedown:
        return (
            f"displacement that a cycle leaves just above shakedown: {limit.shakedown['failure']}"
        )
    if limit.standing:
        return "collapse mechanism of the constant loads"
    lower, upper = (limit.body.get(name) for name in ("lower", "upper"))
    estimate = MeshEstimate(limit.lower, limit.estimate, limit.upper)
    zeta = f"ζ = {estimate.shown} on this mesh"
    if limit.estimate is None:
        zeta = f"ζ = {rounded_down(limit.lower)} at least on this mesh"
    if lower is not None and upper is not None:
        zeta = f"ζ = {rounded_down(lower)} to {rounded_up(upper)}"
    elif upper is not None:
        zeta += f"; limit load of the bodies at most {rounded_up(upper)}"
    return f"collapse mechanism at {zeta}"


@contextmanager
def _drawing(path: Path) -> Iterator[Path]:
    """Create the folder of a picture, and convert exceptions of the drawing to error messages.

    Raises:
        InputError: If the picture cannot be drawn or written; the message names the cause.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield path
    except ImportError as error:
        package = (error.name or str(error)).split(".")[0]
        raise InputError(
            f"'{path}' was not drawn: {package} is not installed; install the Debian package "
            f"python3-{package}, or use pip install {package}."
        ) from error
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError(
            f"'{path}' cannot be written ({reason}); give another path with -o."
        ) from error
