"""Compute stress-free strains: from temperature, initial stress, and shortened bolt shanks.

With an initial strain e₀, the law receives ε(u) − e₀. A change of temperature T gives e₀ = aTδ,
with the expansion coefficient a of the material. A stress σ₀ in the undeformed bodies gives e₀ =
−C⁻¹σ₀. :class:`Shanks` computes the strain that tightened bolts add.

A shank that is shortened by s has e₀ = −s ε(w), where w = φa is a displacement of the bolt alone
along its axis a. The nodal values of φ rise from 0 at the beginning of the shank to 1 at its end.
The law receives ε(u + sw), the strain of a continuous displacement, so a bolt whose shortening
nothing resists has no stress. The force of the shank is N = ⟨σ, ε(w)⟩. In equilibrium this is the
force that one end of the bolt exerts on the other. N is exact on any mesh if no force acts on the
shank between its ends; otherwise N is the mean force along the shank. N also equals ∂J/∂s, the
force conjugate to s.
"""

import math
from collections.abc import Callable, Mapping, Sequence

from mpi4py import MPI

import numpy as np
import ufl
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats, Ints
from perfplast_fenicsx.compat import interpolation_points
from perfplast_fenicsx.errors import InputError, raise_together
from perfplast_fenicsx.formulas import evaluate
from perfplast_fenicsx.materials.law import Material
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.problem.assembled.law_on_cells import LawExpression, LawOnCells, integrate
from perfplast_fenicsx.problem.assembled.spaces import Integral, Spaces, coordinates_of_points
from perfplast_fenicsx.problem.declared.initial import Bolt, Initial, InitialStress, Temperature
from perfplast_fenicsx.spatial_fields import SpatialField


def initial_strain(
    tagged_mesh: TaggedMesh,
    spaces: Spaces,
    materials: Mapping[str, Material],
    laws: Sequence[LawOnCells],
    given: Sequence[Initial],
) -> fem.Function | None:
    """Return e₀ as Mandel vectors at the quadrature points, without the strain of bolts.

    The function returns None if ``given`` is empty.

    Collective.

    Raises:
        InputError: For an unknown volume, a material without expansion, a wrong number of
            components, or a value that is not finite.
    """
    if not given:
        return None
    S, comm = spaces.S, tagged_mesh.mesh.comm
    width, gdim = S.dofmap.index_map_bs, tagged_mesh.mesh.geometry.dim
    stress, strain = fem.Function(S), fem.Function(S)
    thermal: Floats = np.zeros((len(strain.x.array) // width, width))
    before = np.zeros_like(thermal)
    x = coordinates_of_points(S)
    x = np.pad(x, ((0, 0), (0, 3 - x.shape[1])))
    message = None
    for one in given:
        points = np.unique(S.dofmap.list[tagged_mesh.cells(one.on)])
        try:
            if isinstance(one, Temperature):
                thermal[points, :3] += _expansion(materials, one, x, points, gdim)
            elif isinstance(one, InitialStress):
                before[points] += _mandel(one, x, points, width)
        except InputError as error:
            message = message or str(error)
    raise_together(comm, message)
    stress.x.array[:] = before.ravel()
    LawExpression(laws, S, lambda on: -on.law.elastic.compliance(stress)).interpolate(strain)
    strain.x.array[:] += thermal.ravel()
    return strain


def _expansion(
    materials: Mapping[str, Material], given: Temperature, x: Floats, points: Ints, gdim: int
) -> Floats:
    """Return the thermal strain a T at points, shape (num_points, 1)."""
    expansion = float(getattr(materials.get(given.on), "expansion", 0.0))
    if not expansion:
        raise InputError(
            f"the temperature of '{given.on}' changes, but its material has no expansion; "
            "give the material one, such as expansion = 1.2e-5."
        )
    place = f"the temperature of '{given.on}'"
    if isinstance(given.change, SpatialField):
        change = given.change.at(x[points, :gdim], place)
    else:
        change = evaluate(given.change, x[points], place)
    return expansion * change[:, None]


def _mandel(given: InitialStress, x: Floats, points: Ints, width: int) -> Floats:
    """Return σ₀ at points as Mandel vectors, shape (num_points, width)."""
    if len(given.stress) != width:
        # Components of an initial stress for each number of Mandel components.
        components = {4: "xx, yy, zz and xy", 6: "xx, yy, zz, yz, xz and xy"}
        raise InputError(
            f"the initial stress of '{given.on}' has {len(given.stress)} components, but "
            f"this mesh needs {components[width]}; give these {width}."
        )
    place = f"the initial stress of '{given.on}'"
    values = np.column_stack([evaluate(value, x[points], place) for value in given.stress])
    values[:, 3:] *= math.sqrt(2)
    return values


class Shanks:
    """The shanks of all bolts in a problem.

    Attributes:
        bolts: The declared bolts.
        shortening: Shortening of each shank (length), shape (num_bolts,); None before the bolts are
            tightened.
        anew: Names of the bolts that stages tighten again.
    """

    def __init__(
        self,
        tagged_mesh: TaggedMesh,
        spaces: Spaces,
        laws: Sequence[LawOnCells],
        initial: Sequence[Initial],
    ) -> None:
        """Compute the strain of each bolt per unit of shortening. Collective.

        Raises:
            InputError: For an unknown volume, two bolts in one volume or with one name, an axis
                that does not fit the mesh, or a shank outside the volume.
        """
        self.bolts = [one for one in initial if isinstance(one, Bolt)]
        self.shortening: Floats | None = None
        self.anew: tuple[str, ...] = ()
        self._comm, self._laws, self._dx = tagged_mesh.mesh.comm, laws, spaces.dx
        self._units: list[fem.Function] = []
        for number, bolt in enumerate(self.bolts):
            for other in self.bolts[:number]:
                _check_apart(bolt, other)
            self._units.append(_unit_strain(tagged_mesh, spaces, bolt))

    def __repr__(self) -> str:
        return f"Shanks({', '.join(bolt.called for bolt in self.bolts)})"

    @property
    def names(self) -> list[str]:
        """Return the names of the bolts in results."""
        return [bolt.called for bolt in self.bolts]

    @property
    def preloads(self) -> Floats:
        """Return the preload of each bolt (force), shape (num_bolts,)."""
        return np.array([bolt.preload for bolt in self.bolts])

    @property
    def loose(self) -> bool:
        """Return whether the problem has bolts that are not tightened yet."""
        return bool(self.bolts) and self.shortening is None

    def strain(self) -> Floats:
        """Return the bolts' part of e₀ at the points, as the values of a function in S.

        The values are 0 while the bolts are loose.
        """
        total = np.zeros_like(self._units[0].x.array) if self._units else np.zeros(1)
        if self.shortening is not None:
            for shorter, unit in zip(self.shortening, self._units, strict=True):
                total -= shorter * unit.x.array
        return total

    def stiffness(self) -> Floats:
        """Return the stiffness of each shank between fixed ends (force/length), shape (num_bolts,).

        Collective. The function assumes an elastic shank between fixed ends; the real ends, which
        give way, reduce the stiffness.
        """
        found = [self._held(unit) for unit in self._units]
        return np.array(found)

    def forces(self, stress: fem.Function) -> Callable[[], dict[str, float]]:
        """Return a function that computes the force of each bolt by name; tension is positive.

        Args:
            stress: Function in S, whose values may change.

        Returns:
            A collective function, whose forms are compiled once.
        """
        integrals = [Integral(self._comm, ufl.dot(stress, unit) * self._dx) for unit in self._units]
        return lambda: {
            name: integral() for name, integral in zip(self.names, integrals, strict=True)
        }

    def in_words(self) -> list[str]:
        """Return remarks on the bolts for the start of a run; an empty list without bolts."""
        if not self.bolts:
            return []
        told = ", ".join(f"'{bolt.called}' to {bolt.preload:.6g}" for bolt in self.bolts)
        but = (
            f", except for those that stages tighten again ({', '.join(self.anew)})"
            if self.anew
            else ""
        )
        return [
            f"bolts are tightened before any load acts ({told}), and then their shanks keep "
            f"their shortening{but}; a preload does not change a limit load"
        ]

    def _held(self, unit: fem.Function) -> float:
        form = integrate(self._laws, lambda on: ufl.dot(on.law.elastic.hooke(unit), unit))
        return Integral(self._comm, form)()


def _check_apart(bolt: Bolt, other: Bolt) -> None:
    if bolt.on == other.on:
        raise InputError(
            f"the volume '{bolt.on}' has two bolts, '{other.called}' and '{bolt.called}'; give "
            "each bolt a separate volume."
        )
    if bolt.called == other.called:
        raise InputError(
            f"the bolts on '{other.on}' and '{bolt.on}' are both called '{bolt.called}'; give them "
            "different names."
        )


def _unit_strain(tagged_mesh: TaggedMesh, spaces: Spaces, bolt: Bolt) -> fem.Function:
    """Return the strain ε(w) of a bolt at the points, 0 in other bodies. Collective."""
    V, S, kinematics = spaces.V, spaces.S, tagged_mesh.kinematics
    mesh, comm = tagged_mesh.mesh, tagged_mesh.mesh.comm
    cells, gdim = tagged_mesh.cells(bolt.on), mesh.geometry.dim
    if len(bolt.axis) != gdim or (tagged_mesh.axisymmetric and bolt.axis[0] != 0):
        fit = "[0, 1], the axis of revolution" if tagged_mesh.axisymmetric else f"{gdim} numbers"
        raise InputError(
            f"the bolt '{bolt.called}' has axis = {list(bolt.axis)}, which does not fit this mesh;"
            f" give {fit}."
        )
    axis = np.asarray(bolt.axis, dtype=np.float64)
    axis = axis / np.linalg.norm(axis)
    nodes = np.unique(V.dofmap.list[cells])
    along = V.tabulate_dof_coordinates()[nodes, :gdim] @ axis
    low = comm.allreduce(float(along.min(initial=np.inf)), MPI.MIN)
    high = comm.allreduce(float(along.max(initial=-np.inf)), MPI.MAX)
    third = (high - low) / 3
    begin, end = bolt.shank or (low + third, high - third)
    rounding = 1e-9 * (high - low)
    if begin < low - rounding or end > high + rounding:
        low, high = (0.0 if abs(reach) <= rounding else reach for reach in (low, high))
        raise InputError(
            f"the shank of the bolt '{bolt.called}' extends from {begin:g} to {end:g} along its "
            f"axis, but the volume '{bolt.on}' only from {low:.6g} to {high:.6g}; give a range "
            "inside the volume that excludes the head and the nut."
        )
    displacement, strain = fem.Function(V), fem.Function(S)
    ramp = np.clip((along - begin) / (end - begin), 0.0, 1.0)
    displacement.x.array.reshape(-1, gdim)[nodes] = ramp[:, None] * axis
    places = interpolation_points(S.element)
    strain.interpolate(fem.Expression(kinematics.strain(displacement), places), cells)
    return strain
