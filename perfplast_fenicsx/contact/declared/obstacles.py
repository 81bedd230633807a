"""Declare rigid obstacles, which are fixed or translate: planes, spheres and cylinders."""

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
                f"the obstacle at '{self.on}' has friction, so it needs a name under which results "
                "list its force; give name = ..., or remove the friction."
            )


@dataclass(frozen=True)
class Plane(_NamedFriction):
    """A rigid half space.

    Args:
        on: Physical name of the surface that cannot penetrate the obstacle.
        point: A point on the plane (length; 2 or 3 numbers).
        normal: Direction out of the obstacle, towards the body; a vector of any nonzero length.
        move: Translation at ζ = 1 (length; 2 or 3 numbers); by default none.
        tresca: Shear stress at which slip begins (Tresca), not negative; needs a ``name``.
        coulomb: Coefficient of friction (Coulomb), not negative; needs a ``name``. Together with
            it, ``tresca`` is an adhesion.
        name: Name for the force of the obstacle in results; by default the name of its surface.
        associated: Whether slip separates body and obstacle by μ times the slip, as in a dilating
            joint. Only bounds of the body support this.
        reduced: Whether the factor F of ``control = "strength"`` divides the friction of the
            obstacle; by default it does.
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
        """Return the distances of points from the obstacle, and the unit directions into it.

        Args:
            x: Points, shape (n, gdim).

        Returns:
            Distances, negative inside the obstacle, shape (n,); directions, shape (n, gdim).
        """
        normal = _vector(self, "normal", x.shape[1])
        length = np.linalg.norm(normal)
        if length == 0:
            raise InputError(
                f"normal of the plane at '{self.on}' is zero; give a vector of nonzero length."
            )
        normal = normal / length
        return (x - _vector(self, "point", x.shape[1])) @ normal, np.tile(-normal, (len(x), 1))


@dataclass(frozen=True)
class Sphere(_NamedFriction):
    """A rigid ball, or a ball-shaped cavity; a disc in plane meshes.

    Args:
        on: Physical name of the surface that cannot penetrate the obstacle.
        centre: Centre of the ball (length).
        radius: Radius > 0 of the ball (length).
        hollow: Whether the obstacle is the outside of the ball, with the body inside.
        move: Translation at ζ = 1 (length; 2 or 3 numbers); by default none.
        tresca: Shear stress at which slip begins (Tresca), not negative; needs a ``name``.
        coulomb: Coefficient of friction (Coulomb), not negative; needs a ``name``. Together with
            it, ``tresca`` is an adhesion.
        name: Name for the force of the obstacle in results; by default the name of its surface.
        reduced: Whether the factor F of ``control = "strength"`` divides the friction of the
            obstacle; by default it does.
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
        """Return distances and directions; see :meth:`Plane.towards`."""
        return _round(self, x - _vector(self, "centre", x.shape[1]))


@dataclass(frozen=True)
class Cylinder(_NamedFriction):
    """A rigid infinite circular cylinder, or a cylindrical cavity; only in 3D.

    Args:
        on: Physical name of the surface that cannot penetrate the obstacle.
        point: A point on the axis of the cylinder (length).
        axis: Direction of the axis; a vector of any nonzero length.
        radius: Radius > 0 of the cylinder (length).
        hollow: Whether the obstacle is the outside of the cylinder, with the body inside.
        move: Translation at ζ = 1 (length; 2 or 3 numbers); by default none.
        tresca: Shear stress at which slip begins (Tresca), not negative; needs a ``name``.
        coulomb: Coefficient of friction (Coulomb), not negative; needs a ``name``. Together with
            it, ``tresca`` is an adhesion.
        name: Name for the force of the obstacle in results; by default the name of its surface.
        reduced: Whether the factor F of ``control = "strength"`` divides the friction of the
            obstacle; by default it does.
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
        """Return distances and directions; see :meth:`Plane.towards`."""
        if x.shape[1] == 2:
            raise InputError(
                f"the cylinder at '{self.on}' needs a mesh in 3D; give a sphere, "
                "which is a disc in 2D."
            )
        axis = _vector(self, "axis", 3)
        length = np.linalg.norm(axis)
        if length == 0:
            raise InputError(
                f"axis of the cylinder at '{self.on}' is zero; give a vector of nonzero length."
            )
        r = x - _vector(self, "point", 3)
        return _round(self, r - np.outer(r @ axis, axis) / length**2)


Obstacle = Plane | Sphere | Cylinder
"""All classes of obstacles."""

OBSTACLES = {"plane": Plane, "sphere": Sphere, "cylinder": Cylinder}
"""Obstacle classes by the value of ``shape`` in case files."""


def move_of(obstacle: Obstacle, gdim: int) -> Floats:
    """Return the translation of an obstacle at ζ = 1 (length), shape (gdim,).

    Raises:
        InputError: If the translation does not fit the dimension of the mesh.
    """
    return _vector(obstacle, "move", gdim) if len(obstacle.move) else np.zeros(gdim)


def _round(obstacle: Sphere | Cylinder, r: Floats) -> tuple[Floats, Floats]:
    """Return distances and directions for vectors r from the centre, or the axis, to points."""
    shape = type(obstacle).__name__.lower()
    if not (obstacle.radius > 0 and np.isfinite(obstacle.radius)):
        raise InputError(
            f"radius = {obstacle.radius} of the {shape} at '{obstacle.on}' is not a positive "
            "number; give a positive length."
        )
    distance = np.linalg.norm(r, axis=1)
    if (distance <= 1e-12 * obstacle.radius).any():
        where = "at the centre" if isinstance(obstacle, Sphere) else "on the axis"
        raise InputError(
            f"a node of '{obstacle.on}' lies {where} of the {shape}, where the outward normal of "
            f"the {shape} is undefined; name only the part of the surface that may make contact."
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
