"""Declare rigid obstacles, which rest or translate: planes, spheres and cylinders."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.contact.declared.contact import FrictionTerms
from perfplast_fenicsx.errors import InputError


class _NamedFriction(FrictionTerms):
    on: str
    name: str

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.rubs and not self.name:
            raise InputError(
                f"the obstacle at '{self.on}' has friction but no name, which results need "
                "for its force; give name = ..., or remove the friction."
            )


@dataclass(frozen=True)
class Plane(_NamedFriction):
    """A half space.

    Args:
        on: Physical surface that cannot penetrate it.
        point: A point of the plane (length; 2 or 3 numbers).
        normal: Points out of the obstacle, towards the body; any nonzero length.
        move: Motion for ζ = 1 (length; 2 or 3 numbers); the default is no motion.
        tresca: Shear stress at which slip begins (Tresca), not negative; needs a ``name``.
        coulomb: Coefficient of friction (Coulomb), not negative; needs a ``name``. In addition,
            ``tresca`` is an adhesion.
        name: Name of its force in results; by default the name of its surface.
        associated: Whether slip separates body and obstacle by μ times the slip, as in a dilating
            joint. Only bounds of the body support it.
        reduced: Whether F of ``control = "strength"`` divides its friction, as by default.
    """

    on: str
    point: Sequence[float]
    normal: Sequence[float]
    move: Sequence[float] = ()
    tresca: float | None = None
    coulomb: float | None = None
    name: str = ""
    associated: bool = False
    reduced: bool = True

    def towards(self, x: Floats) -> tuple[Floats, Floats]:
        """Return the distance of points to the obstacle and the unit direction into it.

        Args:
            x: Points, shape (n, gdim).

        Returns:
            Distances, negative inside, shape (n,); directions, shape (n, gdim).
        """
        normal = _vector(self, "normal", x.shape[1])
        length = np.linalg.norm(normal)
        if length == 0:
            raise InputError(f"normal of the plane at '{self.on}' is zero; give its direction.")
        normal = normal / length
        return (x - _vector(self, "point", x.shape[1])) @ normal, np.tile(-normal, (len(x), 1))


@dataclass(frozen=True)
class Sphere(_NamedFriction):
    """A ball, or a ball-shaped cavity. In the plane it is a disc.

    Args:
        on: Physical surface that cannot penetrate it.
        centre: Its centre (length).
        radius: Its radius > 0 (length).
        hollow: Whether the obstacle is the outside of the ball, with the body inside.
        move: Motion for ζ = 1 (length; 2 or 3 numbers); the default is no motion.
        tresca: Shear stress at which slip begins (Tresca), not negative; needs a ``name``.
        coulomb: Coefficient of friction (Coulomb), not negative; needs a ``name``. In addition,
            ``tresca`` is an adhesion.
        name: Name of its force in results; by default the name of its surface.
        reduced: Whether F of ``control = "strength"`` divides its friction, as by default.
    """

    on: str
    centre: Sequence[float]
    radius: float
    hollow: bool = False
    move: Sequence[float] = ()
    tresca: float | None = None
    coulomb: float | None = None
    name: str = ""
    reduced: bool = True

    def towards(self, x: Floats) -> tuple[Floats, Floats]:
        """Return distances and directions as :meth:`Plane.towards` does."""
        return _round(self, x - _vector(self, "centre", x.shape[1]))


@dataclass(frozen=True)
class Cylinder(_NamedFriction):
    """An infinite circular cylinder, or a cylindrical cavity. It exists only in 3D.

    Args:
        on: Physical surface that cannot penetrate it.
        point: A point of its axis (length).
        axis: Direction of its axis, of any nonzero length.
        radius: Its radius > 0 (length).
        hollow: Whether the obstacle is the outside of the cylinder, with the body inside.
        move: Motion for ζ = 1 (length; 2 or 3 numbers); the default is no motion.
        tresca: Shear stress at which slip begins (Tresca), not negative; needs a ``name``.
        coulomb: Coefficient of friction (Coulomb), not negative; needs a ``name``. In addition,
            ``tresca`` is an adhesion.
        name: Name of its force in results; by default the name of its surface.
        reduced: Whether F of ``control = "strength"`` divides its friction, as by default.
    """

    on: str
    point: Sequence[float]
    axis: Sequence[float]
    radius: float
    hollow: bool = False
    move: Sequence[float] = ()
    tresca: float | None = None
    coulomb: float | None = None
    name: str = ""
    reduced: bool = True

    def towards(self, x: Floats) -> tuple[Floats, Floats]:
        """Return distances and directions as :meth:`Plane.towards` does."""
        if x.shape[1] == 2:
            raise InputError(f"the cylinder at '{self.on}' is in a plane mesh; give a sphere.")
        axis = _vector(self, "axis", 3)
        length = np.linalg.norm(axis)
        if length == 0:
            raise InputError(f"axis of the cylinder at '{self.on}' is zero; give its direction.")
        r = x - _vector(self, "point", 3)
        return _round(self, r - np.outer(r @ axis, axis) / length**2)


Obstacle = Plane | Sphere | Cylinder
"""All classes of obstacles."""

OBSTACLES = {"plane": Plane, "sphere": Sphere, "cylinder": Cylinder}
"""Obstacles by their ``shape`` in case files."""


def move_of(obstacle: Obstacle, gdim: int) -> Floats:
    """Return the motion of an obstacle for ζ = 1 (length), shape (gdim,).

    Raises:
        InputError: If the motion does not fit the mesh.
    """
    return _vector(obstacle, "move", gdim) if len(obstacle.move) else np.zeros(gdim)


def _round(obstacle: Sphere | Cylinder, r: Floats) -> tuple[Floats, Floats]:
    """Return distance and direction for vectors r from the centre, or the axis, to the points."""
    shape = type(obstacle).__name__.lower()
    if not (obstacle.radius > 0 and np.isfinite(obstacle.radius)):
        raise InputError(
            f"radius = {obstacle.radius} of the {shape} at '{obstacle.on}' is not a positive"
            " number; give a length."
        )
    distance = np.linalg.norm(r, axis=1)
    if (distance <= 1e-12 * obstacle.radius).any():
        raise InputError(
            f"a node of '{obstacle.on}' lies in the middle of the {shape}, where the "
            "direction out of it is undefined; name only the surface that may touch it."
        )
    sign = 1.0 if obstacle.hollow else -1.0
    return sign * (obstacle.radius - distance), sign * r / distance[:, None]


def _vector(obstacle: Obstacle, field: str, gdim: int) -> Floats:
    given = getattr(obstacle, field)
    value = np.atleast_1d(np.asarray(given, dtype=np.float64))
    if value.shape != (gdim,) or not np.isfinite(value).all():
        shape = type(obstacle).__name__.lower()
        raise InputError(
            f"{field} = {np.atleast_1d(given).tolist()} of the {shape} at '{obstacle.on}' does not"
            f" fit a mesh in {gdim}D; give {gdim} finite numbers."
        )
    return value
