"""Define the directions of view, the same in all pictures, and draw their axes."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.pictures.boundary_surface import Surface


@dataclass(frozen=True)
class View:
    """A direction of view, without perspective.

    Attributes:
        words: Name such as "from the front"; empty if there is only one view.
        towards: Direction from the bodies to the viewer.
        up: Direction that points upwards; z for bodies in space.
        axes: Names of the axes x, y and z; an empty one is not drawn.
    """

    words: str
    towards: tuple[float, float, float]
    up: tuple[float, float, float] = (0.0, 0.0, 1.0)
    axes: tuple[str, str, str] = ("x", "y", "z")

    @property
    def frame(self) -> Floats:
        """Unit vectors to the right and upwards in the picture, and out of it, shape (3, 3)."""
        out = np.array(self.towards) / np.linalg.norm(self.towards)
        right = np.cross(self.up, out)
        right /= np.linalg.norm(right)
        return np.array([right, np.cross(out, right), out])


FRONT = View("from the front", (1.1, -1.9, 1.0))
BACK = View("from behind and below", (-1.1, 1.9, -1.0))
LEFT = View("from the left and below", (-1.9, -1.1, -1.0))
RIGHT = View("from the right", (1.9, 1.1, 1.0))
"""Two pairs of opposite directions: each unhidden face is visible from one direction of each pair.
"""

PLANE = View("", (0.0, 0.0, 1.0), (0.0, 1.0, 0.0), ("x", "y", ""))
REVOLVED = View("", (0.0, 0.0, 1.0), (0.0, 1.0, 0.0), ("r", "z", ""))


def view_of(surface: Surface, axisymmetric: bool) -> View:
    """Return the view of a result: the front, unless the back shows twice as much.

    Args:
        surface: Surface with the ``yield_ratio``, whose stressed part is to be visible, or of rigid
            bodies.
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
    """Draw arrows in the directions of x, y and z, into axes of their own.

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
