"""Surfaces that move as rigid bodies, such as the rough base of a footing."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.problem.declared.supports import AXES, Support

Turn = float | Sequence[float]
"""A rotation or moment: a number in the plane, one an axis in space."""


@dataclass(frozen=True)
class RigidSurface:
    """A surface that a rigid plate is glued to: it moves as that does, by small rotations.

    Without a displacement and a rotation it is free to move, and loaded by a ``Force``, and by
    tractions as other surfaces are. With one of them its motion is known, as at a support.

    Args:
        on: Physical surface.
        point: Centre of the rotation (length; 2 or 3 numbers); by default the origin.
        displacement: Displacement of that point (length; 2 or 3 numbers); by default 0.
        rotation: A number in the plane, one for each axis in space (rad), 0 if there is a
            displacement alone.
        components: Letters of x, y, z that its known motion holds; all by default. A
            bar that is twisted so by its end may warp there.
        constant: Whether the motion is the same at any load factor; otherwise ζ multiplies it, or a
            factor of stages.
        name: Name in results and stages; by default that of its surface.
        held: Letters of x, y, z along which a free surface cannot move, as at a plane of symmetry;
            it then does not turn either.
    """

    on: str
    point: Sequence[float] = ()
    displacement: Sequence[float] = ()
    rotation: Turn = ()
    components: str = AXES
    constant: bool = True
    name: str = ""
    held: str = ""

    @property
    def free(self) -> bool:
        """Whether its motion is to be found."""
        return not np.size(self.displacement) and not np.size(self.rotation)

    @property
    def moves(self) -> bool:
        """Whether its known motion is anything but none."""
        return bool(np.any(self.displacement) or np.any(self.rotation))

    def axes(self, gdim: int) -> list[int]:
        """Return indices of the components that it holds, in a mesh of dimension ``gdim``.

        Raises:
            InputError: If letters do not name its axes.
        """
        if self.free and (
            set(self.held) - set(AXES[:gdim]) or len(set(self.held)) < len(self.held)
        ):
            raise InputError(
                f"held = '{self.held}' of the rigid surface '{self.on}' is not a choice of the"
                f" letters in '{AXES[:gdim]}'; write for instance held = 'x'."
            )
        told = Support(self.on, self.held if self.free else self.components)
        if told.guides:
            raise InputError(
                f"components = 'normal' is for supports, not for the rigid surface '{self.on}';"
                f" give letters in '{AXES[:gdim]}'."
            )
        return told.axes(gdim)

    def motion(self, x: Floats) -> Floats:
        """Return the displacement of points (length), for ζ = 1; both of shape (n, gdim).

        Raises:
            InputError: If what is given does not fit the mesh.
        """
        gdim = x.shape[1]
        point, shift = (
            fitting(f"{name} of the rigid surface '{self.on}'", value, gdim)
            for name, value in (("point", self.point), ("displacement", self.displacement))
        )
        turn = fitting(f"rotation of the rigid surface '{self.on}'", self.rotation, 2 * gdim - 3)
        return shift + turned(turn, x - point)


def turned(turn: Floats, arms: Floats) -> Floats:
    """Rotation × arms.

    Args:
        turn: Shape (1,) in the plane, (3,) in space.
        arms: Shape (n, gdim).
    """
    if arms.shape[1] == 2:
        return turn[0] * np.column_stack([-arms[:, 1], arms[:, 0]])
    return np.asarray(np.cross(turn, arms), dtype=np.float64)


def fitting(what: str, value: Turn, size: int) -> Floats:
    """So many finite numbers, zeros where none is given.

    Raises:
        InputError: If they are not, with ``what`` in its message.
    """
    numbers: Floats = np.atleast_1d(np.asarray(value, dtype=np.float64))
    if not numbers.size:
        return np.zeros(size)
    if numbers.shape != (size,) or not np.isfinite(numbers).all():
        raise InputError(
            f"{what} is {numbers.tolist()}, which does not fit the mesh; give {size} finite"
            f" number{'s' if size > 1 else ''}."
        )
    return numbers


def name_of(support: Support | RigidSurface) -> str:
    """Return the name of a support or rigid surface in results."""
    kind = "support" if isinstance(support, Support) else "rigid surface"
    return f"{kind} {support.name or support.on}"
