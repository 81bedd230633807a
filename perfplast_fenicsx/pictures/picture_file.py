"""Define files, headings and directions of view for all pictures."""

import io
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.font_manager import findfont, get_font

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.atomic_files import replace
from perfplast_fenicsx.pictures.boundary_surface import Surface


def replace_picture(path: Path, figure: Any) -> None:
    """Save a matplotlib figure in the format that the file name's suffix names.

    Raises:
        OSError: If the file cannot be written; an existing file is then unchanged.
    """
    image = io.BytesIO()
    figure.savefig(image, format=path.suffix.lstrip(".") or "png")
    replace(path, image.getvalue())


def edges_of_cells(number: int) -> dict[str, Any]:
    """Return arguments of PyVista's ``add_mesh`` that draw thin edges around facets.

    Args:
        number: Number of facets of the bodies; if there are very many, their edges are not drawn.
    """
    most = 40_000  # largest number of facets for which edges are drawn
    style = {"edge_color": "#404040", "edge_opacity": 0.4, "line_width": 0.5}
    return {"show_edges": number <= most, **style}


LONGEST = 90
"""Largest number of characters of a heading that fits on a picture."""

MISSING = "?"
"""Replacement of a character that the font lacks."""


def heading(title: str) -> str:
    """Return the heading of a picture: the title, shortened if necessary.

    Args:
        title: Title of the case, any text.
    """
    return drawable(_short(title))


def drawable(words: str) -> str:
    """Return words of a case, such as names of bodies, with only the characters that the font has.

    Args:
        words: Any text.
    """
    font = get_font(findfont("sans"))
    return "".join(one if font.get_char_index(ord(one)) else MISSING for one in words)


def in_legend(words: str) -> str:
    """Return words of a case for matplotlib, which would read text between dollars as a formula."""
    return drawable(words).replace("$", r"\$")


def remark_on(title: str) -> str | None:
    """Return a remark if the heading differs from the title; otherwise None."""
    if heading(title) == " ".join(title.split()):
        return None
    if heading(title) == _short(title):
        return f"Pictures show only {LONGEST} characters of the title."
    return f"Pictures show {MISSING} for characters of the title that their font lacks."


def _short(title: str) -> str:
    words = " ".join(title.split())
    return words if len(words) <= LONGEST else f"{words[: LONGEST - 3].rstrip()}..."


@dataclass(frozen=True)
class View:
    """A direction of view, without perspective.

    Attributes:
        words: Name of the view, such as "from the front"; empty for the only view.
        towards: Direction from the bodies to the viewer.
        up: Direction that points upwards in the picture; z for 3D bodies.
        axes: Names of the axes x, y and z; an axis with an empty name is not drawn.
    """

    words: str
    towards: tuple[float, float, float]
    up: tuple[float, float, float] = (0.0, 0.0, 1.0)
    axes: tuple[str, str, str] = ("x", "y", "z")

    @property
    def frame(self) -> Floats:
        """Return unit vectors to the right, upwards and out of the picture, shape (3, 3)."""
        out = np.array(self.towards) / np.linalg.norm(self.towards)
        right = np.cross(self.up, out)
        right /= np.linalg.norm(right)
        return np.array([right, np.cross(out, right), out])

    def fitted(self, points: Floats, pixels: tuple[int, int]) -> tuple[Floats, float]:
        """Return the centre of a picture of points, shape (3,), and half its height (length).

        Args:
            points: Points that the picture shows, shape (n, 3).
            pixels: Width and height of the picture.
        """
        seen = points @ self.frame.T
        low, high = seen.min(axis=0), seen.max(axis=0)
        half, (width, height) = (high - low) / 2, pixels
        margin = 1.04
        centre: Floats = (low + high) / 2 @ self.frame
        return centre, float(margin * max(half[1], half[0] * height / width))


FRONT = View("from the front", (1.1, -1.9, 1.0))
BACK = View("from behind and below", (-1.1, 1.9, -1.0))
LEFT = View("from the left and below", (-1.9, -1.1, -1.0))
RIGHT = View("from the right", (1.9, 1.1, 1.0))
"""Two pairs of opposite directions. One direction of each pair shows any face that is not hidden.
"""

PLANE = View("", (0.0, 0.0, 1.0), (0.0, 1.0, 0.0), ("x", "y", ""))
REVOLVED = View("", (0.0, 0.0, 1.0), (0.0, 1.0, 0.0), ("r", "z", ""))


def view_of(surface: Surface, axisymmetric: bool) -> View:
    """Return the view of a result: the front, or the back if it shows over twice the stressed area.

    Args:
        surface: Surface of rigid bodies, or surface with the ``yield_ratio``, whose stressed part
            must be visible.
        axisymmetric: Whether a plane surface is half of a section.
    """
    if surface.plane:
        return REVOLVED if axisymmetric else PLANE
    ratio = surface.at_cells.get("yield_ratio", np.zeros(len(surface.normals)))
    weighed = surface.normals * (ratio**4 + 1e-6)[:, None]
    weighed = weighed[~surface.marks["contact"]]
    front, back = (np.maximum(weighed @ view.towards, 0).sum() for view in (FRONT, BACK))
    return BACK if back > 2 * front else FRONT


def draw_axes(axes: Axes, view: View) -> None:
    """Draw arrows in the directions of x, y and z into their own axes object.

    Args:
        axes: Empty axes to draw into.
        view: Direction of view.
    """
    axes.set(xlim=(-1.45, 1.45), ylim=(-1.45, 1.45), aspect="equal")
    axes.set_axis_off()
    colour = "#404040"
    along: dict[str, Any] = {"arrowstyle": "-|>", "color": colour, "lw": 1.2, "shrinkA": 0}
    right, up, _ = view.frame
    for name, x, y in zip(view.axes, right, up, strict=True):
        if name:
            axes.annotate("", (x, y), (0, 0), arrowprops=along | {"shrinkB": 0})
            length = float(np.hypot(x, y)) or 1.0
            beyond = 1 + 0.28 / length
            axes.text(
                *(beyond * x, beyond * y, name),
                color=colour,
                ha="center",
                va="center",
                fontsize=9,
            )
