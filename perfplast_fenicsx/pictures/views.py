"""From where bodies are seen, the same in all pictures, and the axes that say so."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.pictures.boundary_surface import Surface


@dataclass(frozen=True)
class View:
    """A direction from which something is seen, without perspective.

    Attributes:
        words: Such as "from the front"; empty where there is but one.
        towards: From the bodies to who looks.
        up: What points upwards; z of bodies in space.
        axes: Names of the axes that are seen, those of x, y and z; an empty one is not drawn.
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
"""Two pairs of opposite directions: each face that nothing hides is seen from one of each pair."""

PLANE = View("", (0.0, 0.0, 1.0), (0.0, 1.0, 0.0), ("x", "y", ""))
REVOLVED = View("", (0.0, 0.0, 1.0), (0.0, 1.0, 0.0), ("r", "z", ""))


def view_of(surface: Surface, axisymmetric: bool) -> View:
    """Return the view of a result: the front, unless the back shows twice as much.

    Args:
        surface: With the ``yield_ratio``, of which the stressed skin is to be seen, or rigid.
        axisymmetric: Whether a plane one is half a section.
    """
    if surface.plane:
        return REVOLVED if axisymmetric else PLANE
    ratio = surface.at_cells.get("yield_ratio", np.zeros(len(surface.normals)))
    weighed = surface.normals * (ratio**4 + 1e-6)[:, None]
    weighed = weighed[~surface.marks["contact"]]
    front, back = (np.maximum(weighed @ view.towards, 0).sum() for view in (FRONT, BACK))
    return BACK if back > 2 * front else FRONT


def draw_axes(axes: Axes, view: View) -> None:
    """Arrows that say where x, y and z lead, in axes of their own.

    Args:
        axes: Axes to draw into, which are empty.
        view: From where the bodies are seen.
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
