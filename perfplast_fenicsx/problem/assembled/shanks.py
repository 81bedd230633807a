"""Model the shanks of bolts: how far each is shortened, its strain without stress, and its force.

A shank that is shortened by s has e₀ = −s ε(w). The displacement of the bolt alone along its axis a
is w = φa. The nodal values of φ rise from 0 at the beginning of the shank to 1 at its end. The law
receives ε(u + sw), the strain of a continuous displacement, so that only the shortening strains the
bolt. The force of the shank is N = ⟨σ, ε(w)⟩. In equilibrium this is the force that one end of the
bolt exerts on the other. It is exact on any mesh if no force acts on the shank between its ends;
otherwise it is the mean along the shank. It also equals ∂J/∂s, the force conjugate to s.
"""

from collections.abc import Callable, Sequence

from mpi4py import MPI

import numpy as np
import ufl
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.compat import interpolation_points
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.problem.assembled.integrals import Integral
from perfplast_fenicsx.problem.assembled.law_on_cells import LawOnCells, integrate
from perfplast_fenicsx.problem.assembled.spaces import Spaces
from perfplast_fenicsx.problem.declared.bolt import Bolt
from perfplast_fenicsx.problem.declared.initial import Initial


class Shanks:
    """The shanks of a problem's bolts.

    Attributes:
        bolts: The declared bolts.
        shortening: Shortening of each bolt (length), shape (num_bolts,); None before they are
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
        """Compute the strain of each bolt for a unit of shortening. Collective.

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
        """Return whether there are bolts that are not tightened yet."""
        return bool(self.bolts) and self.shortening is None

    def strain(self) -> Floats:
        """Return the bolts' part of e₀ at the points, as the values of a function of S.

        0 while loose.
        """
        total = np.zeros_like(self._units[0].x.array) if self._units else np.zeros(1)
        if self.shortening is not None:
            for shorter, unit in zip(self.shortening, self._units, strict=True):
                total -= shorter * unit.x.array
        return total

    def stiffness(self) -> Floats:
        """Return the stiffness of each shank between fixed ends (force/length), shape (num_bolts,).

        Collective. The function assumes an elastic shank; the clamped parts reduce the stiffness.
        """
        found = [self._held(unit) for unit in self._units]
        return np.array(found)

    def forces(self, stress: fem.Function) -> Callable[[], dict[str, float]]:
        """Return a function that computes the force of each bolt by its name; tension is positive.

        Args:
            stress: Function of S, whose values may change.

        Returns:
            A collective function. Its forms are compiled once.
        """
        integrals = [Integral(self._comm, ufl.dot(stress, unit) * self._dx) for unit in self._units]
        return lambda: {
            name: integral() for name, integral in zip(self.names, integrals, strict=True)
        }

    def in_words(self) -> list[str]:
        """Return sentences on the bolts before the first level; an empty list without bolts."""
        if not self.bolts:
            return []
        told = ", ".join(f"'{bolt.called}' to {bolt.preload:.6g}" for bolt in self.bolts)
        but = (
            f", except for those that stages tighten again ({', '.join(self.anew)})"
            if self.anew
            else ""
        )
        return [
            f"bolts are tightened before any load acts ({told}), and then keep their "
            f"length{but}; a preload does not change a limit load"
        ]

    def _held(self, unit: fem.Function) -> float:
        form = integrate(self._laws, lambda on: ufl.dot(on.law.elastic.hooke(unit), unit))
        return Integral(self._comm, form)()


def _check_apart(bolt: Bolt, other: Bolt) -> None:
    if bolt.on == other.on:
        raise InputError(
            f"the volume '{bolt.on}' has two bolts, '{other.called}' and '{bolt.called}'; give each"
            " a volume of its own."
        )
    if bolt.called == other.called:
        raise InputError(
            f"two bolts are called '{bolt.called}', on '{other.on}' and on '{bolt.on}'; give them"
            " different names."
        )


def _unit_strain(tagged_mesh: TaggedMesh, spaces: Spaces, bolt: Bolt) -> fem.Function:
    """Return ε(w) at the points, 0 in other bodies. Collective."""
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
            f"the bolt '{bolt.called}' has its shank from {begin:g} to {end:g} along its "
            f"axis, but the volume '{bolt.on}' reaches from {low:.6g} to {high:.6g}; give "
            "a range without head and nut."
        )
    displacement, strain = fem.Function(V), fem.Function(S)
    ramp = np.clip((along - begin) / (end - begin), 0.0, 1.0)
    displacement.x.array.reshape(-1, gdim)[nodes] = ramp[:, None] * axis
    places = interpolation_points(S.element)
    strain.interpolate(fem.Expression(kinematics.strain(displacement), places), cells)
    return strain
