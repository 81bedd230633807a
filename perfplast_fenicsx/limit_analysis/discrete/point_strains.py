"""Evaluate strain rates of velocities at the quadrature points, and the forces of stresses there.

Both are in the coordinates of the points' cones (:mod:`standard_cones`). If all cones are about the
hydrostatic axis, these are trace and deviator of Mandel vectors. In plane strain they contain the
in-plane components. The out-of-plane stress is in no equation, and takes its most favourable value.
"""

from collections.abc import Iterator
from typing import Protocol

from petsc4py import PETSc

import numpy as np
import ufl
from dolfinx import fem
from scipy import sparse

from perfplast_fenicsx.arrays import Floats, PairFlags
from perfplast_fenicsx.compat import create_vector, evaluate, interpolation_points
from perfplast_fenicsx.limit_analysis.discrete.body_cones import BodyCones
from perfplast_fenicsx.limit_analysis.discrete.point_coordinates import PointCoordinates
from perfplast_fenicsx.limit_analysis.discrete.ring_strains import (
    RingCoefficients,
    has_coefficients,
)
from perfplast_fenicsx.problem.assembled.spaces import assemble_force
from perfplast_fenicsx.problem.judged.certificate import contact_forces
from perfplast_fenicsx.problem.problem import Problem


class Rates(Protocol):
    """Strain rates of nodal velocities at the points of a problem, and their transpose.

    Attributes:
        weights: Volume of each point of this rank, shape (count,).
        on_axis: Flags of the points whose rates are zero for all velocities, shape (count,).
    """

    weights: Floats
    on_axis: PairFlags

    def of(self, v: fem.Function) -> Floats:
        """Return ε of a velocity with updated ghosts as Mandel vectors, shape (count, m).

        Collective.

        Each component is contiguous in memory.
        """
        ...

    def forces(self, stress: Floats, out: PETSc.Vec) -> None:
        """Set ``out`` to Σ w σ:ε(v) for all nodal v, zero at supports. Collective.

        Args:
            stress: Mandel vectors, shape (count, m).
            out: A vector of nodal unknowns.
        """
        ...

    def of_unknowns(self) -> Floats:
        """Return ε of the nodal unknowns of each cell that this rank owns. Collective.

        Returns:
            Shape (num_cells, num_points, m, num_unknowns).
        """
        ...


class RatesAtPoints:
    """Rates at quadrature points; see :class:`Rates` for the methods."""

    def __init__(self, problem: Problem) -> None:
        """Compile the expressions. Collective."""
        self._problem = problem
        self._u, self._e = fem.Function(problem.V), fem.Function(problem.S)
        self._stress = fem.Function(problem.S)
        self._places = interpolation_points(problem.S.element)
        self._strain = fem.Expression(problem.kinematics.strain(self._u), self._places)
        self._force_form = fem.form(problem.internal_form(self._stress))
        self.weights: Floats = weights_of_points(problem)
        self.on_axis: PairFlags = np.zeros(len(self.weights), dtype=np.bool_)

    def of(self, v: fem.Function) -> Floats:
        """See :meth:`Rates.of`."""
        self._u.x.array[:] = v.x.array
        evaluate(self._strain, self._e, self._problem.cells)
        count, size = len(self.weights), self._problem.S.dofmap.index_map_bs
        return self._e.x.array[: count * size].reshape(-1, size).copy(order="F")

    def forces(self, stress: Floats, out: PETSc.Vec) -> None:
        """See :meth:`Rates.forces`."""
        self._stress.x.array[: stress.size] = stress.ravel()
        assemble_force(out, self._force_form, self._problem.bcs)

    def of_unknowns(self) -> Floats:
        """See :meth:`Rates.of_unknowns`."""
        problem = self._problem
        topology = problem.tagged_mesh.mesh.topology
        cells = np.arange(topology.index_map(topology.dim).size_local, dtype=np.int32)
        strain = problem.kinematics.strain(ufl.TrialFunction(problem.V))
        e = fem.Expression(strain, self._places).eval(problem.V.mesh, cells)
        shape = len(cells), len(self._places), problem.S.dofmap.index_map_bs, -1
        return np.asarray(e).reshape(shape)


class PointStrains:
    """ε(v) of velocities in the contact basis; see :class:`discretisation.Strains`.

    Attributes:
        rates: Rates of nodal velocities.
        coordinates: Coordinates of stresses and rates at the points.
        profile: See :class:`point_coordinates.PointCoordinates`.
    """

    def __init__(self, problem: Problem, cones: BodyCones | None = None) -> None:
        """Compile the expressions. Collective.

        Args:
            problem: The bodies and the points.
            cones: See :class:`point_coordinates.PointCoordinates`.
        """
        self._problem, self._u = problem, fem.Function(problem.V)
        self._force = problem.create_vector()
        self.rates: Rates
        self.rates = (RingCoefficients if has_coefficients(problem) else RatesAtPoints)(problem)
        self.count = problem.Q.dofmap.index_map.size_local
        self.size = problem.S.dofmap.index_map_bs
        self.weights = self.rates.weights
        self._stress = np.zeros((self.count, self.size))
        self.coordinates = at = PointCoordinates(problem, cones)
        self.radii: Floats = np.where(self.rates.on_axis, np.inf, at.radii)
        self.slopes, self.tilts = at.slopes, at.tilts
        self.sets, self.profile = at.sets, at.profile
        self.gdim = at.normal

    def destroy(self) -> None:
        """Free PETSc's memory. Collective."""
        self._force.destroy()

    def of(self, y: PETSc.Vec) -> tuple[Floats, Floats]:
        """Return trace and deviator of ε(Ty). Collective.

        Returns:
            Shapes (count,) and (count, m).
        """
        self._problem.basis.T.mult(y, self._u.x.petsc_vec)
        self._u.x.scatter_forward()
        return self.of_function(self._u)

    def of_function(self, v: fem.Function) -> tuple[Floats, Floats]:
        """Return trace and deviator of ε(v) for a function with updated ghosts. Collective."""
        return self.coordinates.rates(self.rates.of(v))

    def power_rates(self, v: fem.Function) -> Floats:
        """Return the ε(v) that does the work of stresses, Mandel vectors, shape (count, m).

        Collective.

        If the coordinates are trace and deviator, the volume change of volume-preserving bodies is
        ignored, because it is rounding.

        Args:
            v: Admissible velocity with updated ghosts.
        """
        if not self.coordinates.isotropic:
            return self.rates.of(v)
        sums, e = self.of_function(v)
        e[:, : self.gdim] += (np.where(self.slopes > 0, sums, 0.0) / self.gdim)[:, None]
        return e

    def nodal(self) -> Iterator[Floats]:
        """Yield the rates of each nodal unknown of this rank's cells. Collective.

        Yields:
            Trace and deviator, zero where the unknown is held, shape (num_cells, num_points, 1 +
            m).
        """
        problem, e = self._problem, self.rates.of_unknowns()
        points, nodes = problem.Q.dofmap.list[: len(e)], problem.V.dofmap.list[: len(e)]
        e *= ~problem.fixed[nodes].reshape(len(e), 1, 1, -1)
        mandel = np.zeros((self.count, self.size))
        for unknown in range(e.shape[3]):
            mandel[points] = e[..., unknown]
            yield np.column_stack(self.coordinates.rates(mandel))[points]

    def matrix(self) -> sparse.csr_array:
        """See :meth:`discretisation.Strains.matrix`."""
        problem, parts = self._problem, 1 + self.size
        dim, nodes = problem.V.dofmap.index_map_bs, problem.V.dofmap.list
        unknowns = (nodes[:, :, None] * dim + np.arange(dim)).reshape(len(nodes), -1)
        rows = problem.Q.dofmap.list[: len(nodes)][:, :, None] * parts + np.arange(parts)
        shape = self.count * parts, problem.basis.T.getSize()[0]
        found = sparse.csr_array(shape)
        for rates, column in zip(self.nodal(), unknowns.T, strict=True):
            columns = np.broadcast_to(column[:, None, None], rows.shape)
            places = rows.ravel(), columns.ravel()
            found = found + sparse.csr_array((rates.ravel(), places), shape=shape)
        pointer, columns, values = problem.basis.T.getValuesCSR()
        T = sparse.csr_array((values, columns, pointer), shape=problem.basis.T.getSize())
        return found @ T

    def deviators(self, deviator: Floats) -> Floats:
        """See :meth:`discretisation.Strains.deviators`."""
        if not self.coordinates.isotropic:
            return deviator
        found = deviator.copy()
        found[:, : self.gdim] -= deviator[:, : self.gdim].mean(axis=1, keepdims=True)
        return found

    def forces(self, pressure: Floats, deviator: Floats, out: PETSc.Vec) -> None:
        """Set ``out`` to ∫ σ:ε(v) for all v of the contact basis. Collective."""
        self.coordinates.working(pressure, deviator, self._stress)
        self.forces_of(self._stress, out)

    def forces_of(self, stress: Floats, out: PETSc.Vec) -> None:
        """Set ``out`` to the forces of stresses as Mandel vectors, shape (count, m). Collective."""
        self.rates.forces(stress, self._force)
        self._problem.basis.T.multTranspose(self._force, out)


def forces_of_pairs(
    problem: Problem, stress: fem.Function, zeta: float, times: float = 1.0
) -> Floats:
    """Return the contact forces that balance a stress and the loads. Collective.

    See :func:`~perfplast_fenicsx.problem.judged.certificate.contact_forces` for the forces in other
    problems than those with coefficients as points.
    """
    if not has_coefficients(problem):
        return contact_forces(problem, stress, zeta, times)
    strains, loads = PointStrains(problem), problem.create_vector()
    left, of_loads = problem.create_vector(), problem.create_vector()
    strains.forces_of(stress.x.array[: strains.count * strains.size].reshape(-1, 4), left)
    problem.loads.subtract_from(loads, zeta, times)
    problem.basis.T.multTranspose(loads, of_loads)
    found: Floats = -(left.array_r + of_loads.array_r)[problem.basis.index]
    for thing in (strains, loads, left, of_loads):
        thing.destroy()
    return found


def weights_of_points(problem: Problem) -> Floats:
    """Return the volume of each point of this rank, shape (count,). Collective."""
    vector = create_vector(problem.Q)
    assemble_force(vector, fem.form(ufl.TestFunction(problem.Q) * problem.dx), [])
    weights: Floats = vector.array_r[: problem.Q.dofmap.index_map.size_local].copy()
    vector.destroy()
    return weights
