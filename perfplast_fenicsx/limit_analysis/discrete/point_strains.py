"""Strain rates of velocities at the quadrature points as arrays, and the forces of stresses there.

Both are in the coordinates of the points' cones (:mod:`standard_cones`): where all cones are about
the hydrostatic axis these are trace and deviator of Mandel vectors. In plane strain they are of the
components in the plane: the stress out of it is in no equation, and takes its best value.
"""

from petsc4py import PETSc

import numpy as np
import ufl
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.compat import create_vector, evaluate, interpolation_points
from perfplast_fenicsx.limit_analysis.discrete.point_coordinates import PointCoordinates
from perfplast_fenicsx.problem.assembled.integrals import assemble_force
from perfplast_fenicsx.problem.problem import Problem


class PointStrains:
    """ε(v) of velocities in the contact basis; see :class:`discretisation.Strains`."""

    def __init__(self, problem: Problem) -> None:
        """Compile what evaluates them. Collective."""
        self._problem = problem
        self._u, self._e = fem.Function(problem.V), fem.Function(problem.S)
        self._stress = fem.Function(problem.S)
        points = interpolation_points(problem.S.element)
        self._strain = fem.Expression(problem.kinematics.strain(self._u), points)
        self._force_form = fem.form(problem.internal_form(self._stress))
        self._force = problem.create_vector()
        self.count = problem.Q.dofmap.index_map.size_local
        self.size = problem.S.dofmap.index_map_bs
        self.weights = weights_of_points(problem)
        self.coordinates = at = PointCoordinates(problem)
        self.radii, self.slopes, self.tilts = at.radii, at.slopes, at.tilts
        self.sets, self.profile = at.sets, at.profile
        self.gdim = at.normal

    def destroy(self) -> None:
        """Give PETSc's memory back. Collective."""
        self._force.destroy()

    def of(self, y: PETSc.Vec) -> tuple[Floats, Floats]:
        """Trace and deviator of ε(Ty). Collective.

        Returns:
            Shapes (count,) and (count, m).
        """
        self._problem.basis.T.mult(y, self._u.x.petsc_vec)
        self._u.x.scatter_forward()
        return self._split()

    def of_function(self, v: fem.Function) -> tuple[Floats, Floats]:
        """Return the same of ε(v) for a function whose ghosts are up to date. Collective."""
        self._u.x.array[:] = v.x.array
        return self._split()

    def power_rates(self, v: fem.Function) -> Floats:
        """ε(v) that does the work of stresses, Mandel vectors, shape (count, m). Collective.

        Where the coordinates are trace and deviator it is without the change of volume of bodies
        that keep theirs, which is rounding.

        Args:
            v: Admissible, its ghosts up to date.
        """
        sums, e = self.of_function(v)
        if not self.coordinates.isotropic:
            return self._strains()
        e[:, : self.gdim] += (np.where(self.slopes > 0, sums, 0.0) / self.gdim)[:, None]
        return e

    def _split(self) -> tuple[Floats, Floats]:
        return self.coordinates.rates(self._strains())

    def _strains(self) -> Floats:
        """ε of the velocity that is held, shape (count, m), component by component in memory."""
        evaluate(self._strain, self._e, self._problem.cells)
        e = self._e.x.array[: self.count * self.size].reshape(-1, self.size)
        return e.copy(order="F")

    def forces(self, pressure: Floats, deviator: Floats, out: PETSc.Vec) -> None:
        """Set ``out`` to ∫ σ:ε(v) for all v of the contact basis. Collective."""
        array = self._stress.x.array[: self.count * self.size].reshape(-1, self.size)
        self.coordinates.working(pressure, deviator, array)
        assemble_force(self._force, self._force_form, self._problem.bcs)
        self._problem.basis.T.multTranspose(self._force, out)


def weights_of_points(problem: Problem) -> Floats:
    """Volume that each point of this rank stands for, shape (count,). Collective."""
    vector = create_vector(problem.Q)
    assemble_force(vector, fem.form(ufl.TestFunction(problem.Q) * problem.dx), [])
    weights: Floats = vector.array_r[: problem.Q.dofmap.index_map.size_local].copy()
    vector.destroy()
    return weights
