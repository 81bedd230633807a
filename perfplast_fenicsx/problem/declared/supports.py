"""Declare supports, and surfaces that move as rigid bodies."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.formulas import evaluate
from perfplast_fenicsx.problem.declared.loads import fitting

AXES = "xyz"


@dataclass(frozen=True)
class Support:
    """Prescribed displacement of some components on a surface.

    Args:
        on: Physical name of the surface.
        components: Any of the letters x, y, z; by default all components of the mesh. Or
            ``"normal"`` for the component normal to a flat surface of any orientation, which can
            then slide tangentially, like a plane of symmetry. With a value, the surface may be
            curved.
        value: Prescribed displacement (length), such as a settlement: a number, or a formula in x,
            y, z; by default 0. With "normal" it is the displacement out of the body along the
            normal.
        constant: Whether the displacement is the same at any load factor; if not, ζ or a factor of
            stages multiplies it.
        name: Name in results and stages; by default the name of the surface.
    """

    on: str
    components: str = AXES
    value: float | str = 0.0
    constant: bool = True
    name: str = ""

    @property
    def guides(self) -> bool:
        """Return whether the support holds the displacement along the normal of its surface."""
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
                f"components = '{self.components}' of the support on '{self.on}' must contain only "
                f"letters of '{AXES[:gdim]}', each at most once; write for instance components = "
                "'x', or 'normal' for the normal of a flat surface."
            )
        return sorted(AXES.index(letter) for letter in wanted)

    @property
    def moves(self) -> bool:
        """Return whether the prescribed displacement is a formula or a number other than 0."""
        return self.value != 0

    def motion(self, x: Floats) -> Floats:
        """Return the displacement of points (length) at ζ = 1; both have shape (n, gdim).

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


Turn = float | Sequence[float]
"""A rotation or moment: a number in plane meshes, one for each axis in 3D."""


@dataclass(frozen=True)
class RigidSurface:
    """A surface that moves as if a rigid plate were glued to it; rotations are small.

    Without a displacement and a rotation, the surface is free to move. A ``Force`` and tractions
    can load it. With a displacement or a rotation, its motion is prescribed, as at a support.

    Args:
        on: Physical name of the surface.
        point: Centre of the rotation (length; 2 or 3 numbers); by default the origin.
        displacement: Displacement of ``point`` (length; 2 or 3 numbers); by default 0.
        rotation: A number in plane meshes, one for each axis in 3D (rad); 0 if only a displacement
            is given.
        components: Letters of x, y, z that the prescribed motion holds; by default all. If the
            motion holds only some components, a bar that is twisted at its end can warp there.
        constant: Whether the motion is the same at any load factor; if not, ζ or a factor of stages
            multiplies it.
        name: Name in results and stages; by default the name of the surface.
        held: Letters of x, y, z along which a free surface cannot move, as at a plane of symmetry.
            The surface then does not rotate either.
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
        """Return whether the motion of the surface is an unknown."""
        return not np.size(self.displacement) and not np.size(self.rotation)

    @property
    def moves(self) -> bool:
        """Return whether the prescribed motion differs from zero."""
        return bool(np.any(self.displacement) or np.any(self.rotation))

    def axes(self, gdim: int) -> list[int]:
        """Return indices of the components that the surface holds, in a mesh of dimension ``gdim``.

        Raises:
            InputError: If letters are not axes of the mesh.
        """
        if self.free and (
            set(self.held) - set(AXES[:gdim]) or len(set(self.held)) < len(self.held)
        ):
            raise InputError(
                f"held = '{self.held}' of the rigid surface '{self.on}' must contain only letters "
                f"of '{AXES[:gdim]}', each at most once; write for instance held = 'x'."
            )
        told = Support(self.on, self.held if self.free else self.components)
        if told.guides:
            raise InputError(
                "components = 'normal' applies only to supports, not to the rigid surface "
                f"'{self.on}'; give letters of '{AXES[:gdim]}'."
            )
        return told.axes(gdim)

    def motion(self, x: Floats) -> Floats:
        """Return the displacement of points (length) at ζ = 1; both have shape (n, gdim).

        Raises:
            InputError: If the declared motion does not fit the mesh.
        """
        gdim = x.shape[1]
        point, shift = (
            fitting(f"{name} of the rigid surface '{self.on}'", value, gdim)
            for name, value in (("point", self.point), ("displacement", self.displacement))
        )
        turn = fitting(f"rotation of the rigid surface '{self.on}'", self.rotation, 2 * gdim - 3)
        return shift + turned(turn, x - point)


def turned(turn: Floats, arms: Floats) -> Floats:
    """Return the cross product of the rotation and the arms.

    Args:
        turn: Rotation, shape (1,) in plane meshes, (3,) in 3D.
        arms: Vectors from the centre of the rotation to points, shape (n, gdim).
    """
    if arms.shape[1] == 2:
        return turn[0] * np.column_stack([-arms[:, 1], arms[:, 0]])
    return np.asarray(np.cross(turn, arms), dtype=np.float64)


def name_of(support: Support | RigidSurface) -> str:
    """Return the name of a support or a rigid surface in results."""
    kind = "support" if isinstance(support, Support) else "rigid surface"
    return f"{kind} {support.name or support.on}"
