"""Declare supports, named by physical surface."""

from dataclasses import dataclass

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.formulas import evaluate

AXES = "xyz"


@dataclass(frozen=True)
class Support:
    """Prescribed displacement of some components on a surface.

    Args:
        on: Physical surface.
        components: Any of the letters x, y, z; the default holds all components of the mesh. Or
            ``"normal"`` for the component normal to a flat surface of any direction, which may then
            slide tangentially, as a plane of symmetry does. With a value the surface may be curved.
        value: Prescribed displacement (length), such as a settlement; with "normal" the
            displacement out of the body along the normal. A number, or a formula in x, y, z. The
            default is no displacement.
        constant: Whether it is the same at any load factor; otherwise ζ multiplies it, or a factor
            of stages.
        name: Name in results and stages; by default the name of its surface.
    """

    on: str
    components: str = AXES
    value: float | str = 0.0
    constant: bool = True
    name: str = ""

    @property
    def guides(self) -> bool:
        """Return whether the support holds the normal of its surface instead of components."""
        return self.components == "normal"

    def axes(self, gdim: int) -> list[int]:
        """Return indices of the supported components, in a mesh of dimension ``gdim``.

        The result is empty for a support along a normal.
        """
        if self.guides:
            return []
        wanted = AXES[:gdim] if self.components == AXES else self.components
        if not wanted or set(wanted) - set(AXES[:gdim]) or len(set(wanted)) < len(wanted):
            raise InputError(
                f"components = '{self.components}' of the support on '{self.on}' is not a "
                f"choice of the letters in '{AXES[:gdim]}'; write for instance components "
                "= 'x', or 'normal' for the normal of a flat surface."
            )
        return sorted(AXES.index(letter) for letter in wanted)

    @property
    def moves(self) -> bool:
        """Return whether the displacement differs from 0."""
        return self.value != 0

    def motion(self, x: Floats) -> Floats:
        """Return the displacement of points (length) for ζ = 1; both of shape (n, gdim).

        For a support along a normal, each component is the displacement along the normal.

        Raises:
            InputError: If the value is not finite or not a formula.
        """
        if not isinstance(self.value, str) and not np.isfinite(self.value):
            raise InputError(
                f"value = {self.value} of the support on '{self.on}' is not finite; give a "
                "length, or 0 for no displacement."
            )
        points = np.pad(x, ((0, 0), (0, 3 - x.shape[1])))
        values = evaluate(self.value, points, f"value of the support on '{self.on}'")
        return np.tile(values[:, None], x.shape[1])
