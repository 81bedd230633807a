"""Draw ``fields.png`` and ``mechanism.png``: panels of the deformed bodies in one state."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from perfplast_fenicsx.io.case.scene import Scene
from perfplast_fenicsx.pictures.boundary_surface import Surface
from perfplast_fenicsx.pictures.picture_file import heading, replace_picture
from perfplast_fenicsx.pictures.renderer import Acting, Renderer, compose, panels
from perfplast_fenicsx.problem.judged.report import LevelReport

SHOWN_DEFORMATION, SHOWN_MECHANISM = 0.1, 0.04
"""Approximate size of the largest displacement in a picture, relative to the size of the bodies."""


def draw_fields(
    surface: Surface,
    scene: Scene,
    caption: str,
    path: Path,
    largest_dissipation: float | None = None,
    state: Acting | None = None,
    unique: bool = True,
) -> None:
    """Draw the deformed bodies: plastic zone, displacement, contact pressure, slip and friction.

    Args:
        surface: Surface with ``displacement``, ``contact_pressure``, ``yield_ratio`` and the marks
            of the scene. With friction it also has ``slip`` and ``friction_stress``. The
            displacement of a mechanism is its velocity.
        scene: Surroundings of the bodies, and texts.
        caption: Second line of the heading.
        path: The PNG file.
        largest_dissipation: Largest dissipation of all cells, given only for mechanisms. The
            picture then shows the ``dissipation`` instead of the displacement.
        state: Factors of loads and obstacles; by default the factors at ζ = 0.
        unique: Whether the stress is unique, as at a level. The stress of a limit load is not
            unique.

    Raises:
        OSError: If the file cannot be written.
    """
    shown = panels([surface], scene.units, largest_dissipation, unique=unique)
    wanted = SHOWN_DEFORMATION if largest_dissipation is None else SHOWN_MECHANISM
    scale = deformation_scale([surface], wanted)
    pixels = (1000, 800)  # size of a panel
    renderer = Renderer([surface], scene, scale, pixels, [state or Acting()])
    images = [renderer.draw(0, panel) for panel in shown]
    how = in_words(scale)
    if largest_dissipation is not None:
        how = velocity_in_words(scale * _largest([surface]) / surface.size)
    words = (heading(scene.title), f"{caption},   {how}{scene.view}")
    replace_picture(path, compose(shown, images, words, renderer.view))


def deformation_scale(frames: Sequence[Surface], shown: float = SHOWN_DEFORMATION) -> float:
    """Return a round scale (1, 2 or 5 times a power of ten) that makes the deformation visible.

    Args:
        frames: One skin in one or more states.
        shown: Size of the largest displacement in the picture, relative to the size of the bodies.
    """
    largest = _largest(frames)
    wanted = shown * frames[0].size / largest if largest > 0 else 1.0
    if not (math.isfinite(wanted) and wanted > 0):
        return 1.0
    power = 10.0 ** math.floor(math.log10(wanted))
    return float(max(digit * power for digit in (1, 2, 5) if digit * power <= wanted * (1 + 1e-9)))


def _largest(frames: Sequence[Surface]) -> float:
    """Return the largest displacement in all states (length)."""
    sizes = [np.linalg.norm(a.at_points["displacement"], axis=1).max(initial=0) for a in frames]
    return float(max(sizes))


def velocity_in_words(share: float) -> str:
    """Return a note on the scale of a drawn mechanism, whose velocity has no absolute size.

    Args:
        share: Largest displacement in the picture, relative to the size of the bodies.
    """
    return f"velocities, the largest drawn as {100 * share:.2g} % of the size of the bodies"


def in_words(scale: float) -> str:
    """Return the scale of the deformation in words."""
    return "deformation to scale" if scale == 1 else f"deformation enlarged {scale:g} times"


def level_caption(report: LevelReport | None, driven: bool, unit: str) -> str:
    """Return a level in words, or words for the unloaded bodies.

    Args:
        report: Report of the level; None for the unloaded bodies.
        driven: Whether ζ moves supports and obstacles.
        unit: Unit of α.
    """
    if report is not None and report.factors:
        factors = [f"{name} = {factor:.6g}" for name, factor in report.factors.items()]
        return f"{report.stage or 'at rest'}:   {',   '.join(factors)}"
    zeta, alpha, force = (
        (report.zeta, report.alpha, report.driving_force) if report else (0.0, 0.0, 0.0)
    )
    if driven:
        return f"load factor ζ = {zeta:.6g},   driving force {force:.5g}"
    return f"load factor ζ = {zeta:.6g},   work of the loads α = {alpha:.5g} {unit}".rstrip()
