"""Pictures of the skin of the bodies: of one state, or the same of many. Single-process."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.io.case.scene import Scene
from perfplast_fenicsx.pictures.annotations import best_view, load_arrows, sample_obstacles
from perfplast_fenicsx.pictures.boundary_surface import Surface
from perfplast_fenicsx.pictures.picture_file import replace_picture
from perfplast_fenicsx.pictures.render_process import images, not_installed

if TYPE_CHECKING:
    from perfplast_fenicsx.pictures.figure_panels import Panel

SHOWN_DEFORMATION, SHOWN_MECHANISM = 0.1, 0.04
"""The largest displacement is drawn about so large, relative to the size of the assembly."""

PIXELS = (1000, 800)
"""Of a panel."""


def draw_surface(
    surface: Surface,
    model: Scene,
    caption: str,
    path: Path,
    largest_dissipation: float | None = None,
) -> None:
    """Draw deformed bodies with plastic zone, displacement and contact pressure.

    Args:
        surface: With ``displacement``, ``contact_pressure``, ``yield_ratio`` and the marks of the
            model. Of a mechanism the displacement is the velocity.
        model: What is around the bodies, and words.
        caption: Second line of the heading.
        path: The png file.
        largest_dissipation: Of all cells; for mechanisms alone, where the ``dissipation`` is shown
            instead of the displacement.

    Raises:
        DrawingError: If there is nothing to draw with.
        OSError: If the file cannot be written.
    """
    need_matplotlib()
    from perfplast_fenicsx.pictures.figure_panels import compose, panels

    shown = panels([surface], model.units, largest_dissipation)
    wanted = SHOWN_DEFORMATION if largest_dissipation is None else SHOWN_MECHANISM
    scale = deformation_scale([surface], wanted)
    drawn = draw_panels([surface], model, shown, scale)
    words = (model.title, f"{caption},   {in_words(scale)}")
    replace_picture(path, compose(shown, drawn[0], words))


def draw_panels(
    frames: Sequence[Surface],
    model: Scene,
    shown: "Sequence[Panel]",
    scale: float,
    pixels: tuple[int, int] = PIXELS,
) -> npt.NDArray[np.uint8]:
    """Images of the panels of all frames, seen by one camera.

    Args:
        frames: One skin with one or more states.
        model: What is around the bodies.
        shown: Of these frames.
        scale: Of the displacements.
        pixels: Width and height of each image.

    Returns:
        Shape (num_frames, num_panels, height, width, 3).

    Raises:
        DrawingError: If there is nothing to draw with.
    """
    from perfplast_fenicsx.pictures.figure_panels import hue

    last = frames[-1]
    points = np.array([a.points + scale * a.at_points["displacement"] for a in frames])
    # of the same facets in all frames, so that arrows move with the bodies and do not jump
    arrows = [load_arrows(last, moved, model.on_surfaces) for moved in points]
    near = sample_obstacles(last, points.reshape(-1, 3), model.obstacles)
    arrays = {
        "undeformed": last.points,
        "points": points,
        "triangles": last.triangles,
        "facets": last.facets,
        "body": last.body,
        "opposite": last.marks["opposite"],
        "arrow_starts": np.array([of_frame.starts for of_frame in arrows]),
        "arrows": arrows[-1].vectors,
        **{f"colours {i}": panel.colours for i, panel in enumerate(shown)},
        **{f"facets {i}": p.facets for i, p in enumerate(shown) if p.facets is not None},
        **{f"obstacle {i}": distance for i, distance in enumerate(near.distances)},
    }
    about = {
        "hues": [hue(body) for body in range(len(last.names))],
        "view": best_view(last),
        "loads": [panel.loads for panel in shown],
        "corner": near.corner.tolist(),
        "spacing": near.spacing.tolist(),
        "num_obstacles": len(model.obstacles),
        "pixels": pixels,
    }
    return images(arrays, about, len(frames))


def deformation_scale(frames: Sequence[Surface], shown: float = SHOWN_DEFORMATION) -> float:
    """A round number (1, 2 or 5 times a power of ten) that makes the largest deformation visible.

    Args:
        frames: One skin with one or more states.
        shown: How large it is drawn, relative to the bodies.
    """
    sizes = [np.linalg.norm(a.at_points["displacement"], axis=1).max(initial=0) for a in frames]
    largest = float(max(sizes))
    wanted = shown * frames[0].size / largest if largest > 0 else 1.0
    if not (math.isfinite(wanted) and wanted > 0):
        return 1.0
    power = 10.0 ** math.floor(math.log10(wanted))
    return float(max(digit * power for digit in (1, 2, 5) if digit * power <= wanted * (1 + 1e-9)))


def in_words(scale: float) -> str:
    """How large the deformation is drawn."""
    return "deformation to scale" if scale == 1 else f"deformation drawn {scale:g} times as large"


def need_matplotlib() -> None:
    """Make sure that there is matplotlib.

    Raises:
        DrawingError: If there is none.
    """
    try:
        import matplotlib  # noqa: F401
    except ImportError as error:
        raise not_installed("matplotlib") from error
