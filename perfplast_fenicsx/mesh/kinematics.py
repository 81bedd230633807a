"""Define the meaning of mesh coordinates: 3D, plane strain, plane stress or axisymmetry.

Everything that depends on this meaning is defined here: the strain of a displacement, the measure
of integrals, and the rigid motions.

In axisymmetry the coordinate x of the mesh is the radius r ≥ 0, and y is the axial coordinate z.
The out-of-plane component of strains and stresses is the hoop component: ε = (u_r,r, u_z,z, u_r/r,
√2 ε_rz). Integrals are over the full turn, with the measures 2πr dr dz and 2πr ds, so all forces
and works refer to the full turn.
"""

import math
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
import ufl
from ufl.domain import extract_unique_domain

from perfplast_fenicsx.arrays import Floats

ON_AXIS = 1e-10
"""Points count as lying on the axis if their radius, relative to the size of the bodies, is below
this value."""


class Kinematics(Protocol):
    """The meaning of the coordinates of a mesh.

    The methods :meth:`measure`, :meth:`around`, :meth:`carried` and :meth:`held` of this class are
    for Cartesian coordinates.

    Attributes:
        name: The ``kind`` in ``[model]``.
        axes: Letters of the force components in results.
        whole: Whether forces and works refer to whole bodies. In plane strain and plane stress they
            are per unit of depth or thickness, and no equilibrium equation contains the
            out-of-plane stress.
        forces: Words for the unit of depth, or the part of the bodies, to which forces and works
            refer; empty for whole bodies in 3D.
        motions: The rigid motions in words.
        thickness: Thickness (length), by which forces on whole surfaces are divided; 1 except in
            plane stress.
    """

    thickness: float = 1.0
    name: str
    axes: str
    whole: bool
    forces: str
    motions: tuple[str, ...]

    def strain(self, u: Any) -> Any:
        """Return the small strain ε(u) in UFL as a Mandel vector, shape (6,), or (4,) in 2D."""
        ...

    def measure(self, measure: ufl.Measure) -> Any:
        """Return the measure of the bodies from that of the mesh; function * measure is a form."""
        return measure

    def around(self, x: Floats) -> Floats:
        """Return the out-of-plane measure at points: the circumference 2πr (length), or 1.

        Args:
            x: Points, shape (..., gdim).

        Returns:
            Measure, shape (...,).
        """
        return np.ones(x.shape[:-1])

    def carried(self, x: Floats) -> Floats:
        """Return the value that an unknown has at points where the displacement is 1.

        Args:
            x: Points, shape (..., gdim).

        Returns:
            Unknowns, shape (...,).
        """
        return np.ones(x.shape[:-1])

    def rigid_modes(self, r: Floats) -> Floats:
        """Return rigid motions at points: translations, then rotations about the origin.

        Args:
            r: Points, shape (n, 3).

        Returns:
            Displacements, shape (n, gdim, number of motions).
        """
        ...

    def held(self, x: Floats, size: float) -> npt.NDArray[np.bool_]:
        """Return which displacement components are always zero at points: u_r on the axis.

        Args:
            x: Points, shape (n, 3).
            size: Size of the bodies (length).

        Returns:
            Flags, shape (n, gdim).
        """
        return np.zeros((len(x), len(self.axes)), dtype=np.bool_)


def divergence(kinematics: Kinematics, v: Any) -> Any:
    """Return the rate of volume change tr ε(v) in UFL."""
    e = kinematics.strain(v)
    return e[0] + e[1] + e[2]


class Space(Kinematics):
    """Bodies in 3D, meshed by tetrahedra."""

    name: str = "space"
    axes: str = "xyz"
    whole: bool = True
    forces: str = ""
    motions: tuple[str, ...] = (
        *("translation in x", "translation in y", "translation in z"),
        *("rotation about x", "rotation about y", "rotation about z"),
    )

    def strain(self, u: Any) -> Any:
        """Return the strain, see :meth:`Kinematics.strain`."""
        grad = ufl.grad(u)
        pairs = ((1, 2), (0, 2), (0, 1))
        shears = [(grad[i, j] + grad[j, i]) / math.sqrt(2) for i, j in pairs]
        return ufl.as_vector([*(grad[i, i] for i in range(3)), *shears])

    def rigid_modes(self, r: Floats) -> Floats:
        """Return the rigid motions, see :meth:`Kinematics.rigid_modes`."""
        return _rigid_modes(r, 3, ((1, 2), (2, 0), (0, 1)))


class PlaneStrain(Kinematics):
    """Plane strain: sections of bodies that are infinite along z and do not deform along z."""

    name: str = "plane-strain"
    axes: str = "xy"
    whole: bool = False
    forces: str = "per unit of depth"
    motions: tuple[str, ...] = ("translation in x", "translation in y", "rotation")

    def strain(self, u: Any) -> Any:
        """Return the strain, see :meth:`Kinematics.strain`."""
        return _in_plane(ufl.grad(u), 0)

    def rigid_modes(self, r: Floats) -> Floats:
        """Return the rigid motions, see :meth:`Kinematics.rigid_modes`."""
        return _rigid_modes(r, 2, ((0, 1),))


class PlaneStress(PlaneStrain):
    """Plane stress: sheets whose thickness can change, because no stress acts across them.

    The strain across the sheet is stored as zero, and no law uses it.
    """

    name: str = "plane-stress"
    forces: str = "per unit of thickness"

    def __init__(self, thickness: float = 1.0) -> None:
        """Set the thickness (length)."""
        self.thickness = thickness


class Axisymmetric(Kinematics):
    """Half sections of bodies of revolution: x is r, and y is the axial coordinate z."""

    name: str = "axisymmetric"
    axes: str = "rz"
    whole: bool = True
    forces: str = "of the full turn (r: outward, summed around the axis; z: along the axis)"
    motions: tuple[str, ...] = ("translation along the axis",)

    def strain(self, u: Any) -> Any:
        """Return the strain, see :meth:`Kinematics.strain`."""
        return _in_plane(ufl.grad(u), u[0] / _radius(extract_unique_domain(u)))

    def measure(self, measure: ufl.Measure) -> Any:
        """Return the measure, see :meth:`Kinematics.measure`."""
        return AroundAxis(measure)

    def around(self, x: Floats) -> Floats:
        """Return the out-of-plane measure at points, see :meth:`Kinematics.around`."""
        ring: Floats = 2 * math.pi * x[..., 0]
        return ring

    def rigid_modes(self, r: Floats) -> Floats:
        """Return the rigid motions, see :meth:`Kinematics.rigid_modes`."""
        modes = np.zeros((len(r), 2, 1))
        modes[:, 1] = 1
        return modes

    def held(self, x: Floats, size: float) -> npt.NDArray[np.bool_]:
        """Return the held components, see :meth:`Kinematics.held`."""
        held = np.zeros((len(x), 2), dtype=np.bool_)
        held[:, 0] = np.abs(x[:, 0]) <= ON_AXIS * size
        return held


@dataclass(frozen=True)
class RingFlux(Axisymmetric):
    """Bodies of revolution with the unknown v = ru in place of the displacement u.

    On the axis v is zero. The volume is preserved if the plane divergence of v in the section is
    zero. Polynomials can satisfy this condition everywhere, for any flow through a ring. Strains rε
    and measures 2π dμ replace ε and 2πr dμ, so the works of v and u are equal.

    Attributes:
        shift: Radius of the bodies' centre divided by their size
            (:class:`connected_bodies.Bodies`).
    """

    shift: float = 0.0

    def strain(self, u: Any) -> Any:
        """Return rε(u) in terms of v = ru."""
        grad, r = ufl.grad(u), _radius(extract_unique_domain(u))
        shear = (grad[0, 1] + grad[1, 0] - u[1] / r) / math.sqrt(2)
        return ufl.as_vector([grad[0, 0] - u[0] / r, grad[1, 1], u[0] / r, shear])

    def measure(self, measure: ufl.Measure) -> Any:
        """Return the measure, see :meth:`Kinematics.measure`."""
        return AroundAxis(measure, weighed=False)

    def around(self, x: Floats) -> Floats:
        """Return the out-of-plane measure at points, see :meth:`Kinematics.around`."""
        return np.full(x.shape[:-1], 2 * math.pi)

    def carried(self, x: Floats) -> Floats:
        """Return the unknowns, see :meth:`Kinematics.carried`."""
        radius: Floats = x[..., 0]
        return radius

    def rigid_modes(self, r: Floats) -> Floats:
        """Return the rigid motions, see :meth:`Kinematics.rigid_modes`.

        The coordinates in ``r`` are relative to the centre of the bodies.
        """
        modes = np.zeros((len(r), 2, 1))
        modes[:, 1, 0] = r[:, 0] + self.shift
        return modes

    def held(self, x: Floats, size: float) -> npt.NDArray[np.bool_]:
        """Return the held components, see :meth:`Kinematics.held`."""
        radius = super().held(x, size)[:, :1]
        return np.repeat(radius, 2, axis=1)


@dataclass(frozen=True)
class AroundAxis:
    """The measure 2πr dμ of the full turn, for a measure dμ on the half section.

    Attributes:
        section: Measure dμ on the half section.
        weighed: Whether the measure contains the factor r; without it the measure is 2π dμ.
    """

    section: ufl.Measure
    weighed: bool = True

    def __rmul__(self, integrand: Any) -> ufl.Form:
        """Return the integral of a function over the full turn."""
        radius = _radius(self.ufl_domain()) if self.weighed else 1.0
        return (2 * math.pi * radius * integrand) * self.section

    def __call__(self, *args: Any, **arguments: Any) -> "AroundAxis":
        """Return the measure on a part of the section, like a call of a :class:`ufl.Measure`."""
        return replace(self, section=self.section(*args, **arguments))

    def ufl_domain(self) -> Any:
        """Return the mesh of the section."""
        return self.section.ufl_domain()


_ALL: tuple[Kinematics, ...] = (Space(), PlaneStrain(), PlaneStress(), Axisymmetric())

KINDS = {one.name: one for one in _ALL}
"""Kinematics by the names in case files: 3D, plane strain, plane stress and axisymmetry."""


def _radius(domain: Any) -> Any:
    return ufl.SpatialCoordinate(domain)[0]


def _in_plane(grad: Any, out_of_plane: Any) -> Any:
    shear = (grad[0, 1] + grad[1, 0]) / math.sqrt(2)
    return ufl.as_vector([grad[0, 0], grad[1, 1], out_of_plane, shear])


def _rigid_modes(r: Floats, gdim: int, planes: tuple[tuple[int, int], ...]) -> Floats:
    modes = np.zeros((len(r), gdim, gdim + len(planes)))
    modes[:, range(gdim), range(gdim)] = 1
    for k, (i, j) in enumerate(planes, start=gdim):
        modes[:, i, k], modes[:, j, k] = -r[:, j], r[:, i]
    return modes
