"""Evaluate strain rates at points in the coordinates of the points' cones, and forces of stresses.

Strain rates and stresses are in the coordinates of the points' cones (:mod:`standard_cones`). If
the axis of all cones is hydrostatic, the coordinates are the trace and the deviator of Mandel
vectors. In plane strain, the coordinates describe the in-plane components. No equation contains the
out-of-plane stress, and this stress takes its most favourable value.

:class:`StressFrames` transforms stresses and strain rates to these coordinates.

:class:`PointCoordinates` contains the coordinates and the cones of a problem's points. In plane
strain, isotropic coordinates are in-plane vectors with four stored components.

:class:`RingCoefficients` evaluates strain rates of v = ru in axisymmetry by Bernstein coefficients,
for dilating ground. For the strain rates ε of u, r²ε is quadratic in a cell of the section
(:func:`~perfplast_fenicsx.mesh.ring_polynomials.ring_rates`). The admissible strain rates of a
yield set form a convex cone, and Bernstein polynomials are not negative. Therefore r²ε lies in the
cone everywhere in the cell if its six coefficients q_i lie in the cone. The dissipation D is convex
and homogeneous of degree one, so ∫ D(ε) r ≤ Σ D(q_i) ∫ B_i/r. Each coefficient is therefore treated
as a point of the cell. The strain rate at the point is q_i/ρ_i with the coefficient ρ_i of r, and
the weight is ρ_i ∫ B_i/r. On the axis, ρ_i and q_i are zero; the program treats points on the axis
as elastic.
"""

import math
from collections.abc import Iterator
from typing import Protocol

from petsc4py import PETSc

import numpy as np
import ufl
from dolfinx import fem, la
from scipy import sparse

from perfplast_fenicsx.arrays import Floats, Ints, Longs, PairFlags
from perfplast_fenicsx.compat import create_vector, evaluate, interpolation_points
from perfplast_fenicsx.limit_analysis.conic.cone import PointSets
from perfplast_fenicsx.limit_analysis.discrete.body_cones import BodyCones, body_cones
from perfplast_fenicsx.limit_analysis.discrete.strength_fields import strengths_at_points
from perfplast_fenicsx.mesh.kinematics import RingFlux
from perfplast_fenicsx.mesh.ring_polynomials import (
    coefficients_of_radius,
    equal_parts,
    of_parts,
    ring_rates,
    weights_of_rates,
)
from perfplast_fenicsx.mesh.straight_geometry import corners, gradients
from perfplast_fenicsx.problem.assembled.spaces import assemble_force
from perfplast_fenicsx.problem.judged.certificate import contact_forces
from perfplast_fenicsx.problem.problem import Problem


class StressFrames:
    """The transformation x = F (p, s) at points, grouped by cones.

    Attributes:
        size: Number of components of s; components that a cone lacks are zero.
    """

    def __init__(self, cones: BodyCones, of_points: Longs, size: int | None = None) -> None:
        """Group the points by their cones.

        Args:
            cones: Cones of the bodies.
            of_points: Index of the cone of each point.
            size: Number of components of s; by default the largest number over all cones.
        """
        frames = [cone.standard.frame for cone in cones.cones]
        self.size = max(F.shape[1] - 1 for F in frames) if size is None else size
        self.frames = [np.pad(F, ((0, 0), (0, self.size + 1 - F.shape[1]))) for F in frames]
        self._cones, self._count = cones, len(of_points)
        self.groups = [np.flatnonzero(of_points == i) for i in range(len(frames))]

    def rates(self, e: Floats) -> tuple[Floats, Floats]:
        """Return the coordinates ε' of strain rates, shapes (count,) and (count, size).

        Args:
            e: Components of strain rates in the equations, shape (count, n).
        """
        found = np.zeros((self._count, self.size + 1))
        for here, F in zip(self.groups, self.frames, strict=True):
            found[here] = e[here] @ F
        return found[:, 0].copy(), found[:, 1:].copy(order="F")

    def stresses(self, pressure: Floats, deviator: Floats) -> Floats:
        """Return the stress components in the equations, shape (count, n)."""
        both = np.column_stack([pressure, deviator])
        found = np.zeros((self._count, len(self.frames[0])))
        for here, F in zip(self.groups, self.frames, strict=True):
            found[here] = both[here] @ F.T
        return found

    def whole(self, stress: Floats) -> Floats:
        """Return Mandel vectors of stresses from :meth:`stresses`, shape (count, m)."""
        found = np.zeros((self._count, 4 if stress.shape[1] == 3 else stress.shape[1]))
        for here, cone in zip(self.groups, self._cones.cones, strict=True):
            found[here] = cone.whole(stress[here])
        return found


class PointCoordinates:
    """Coordinates (p, s) of stresses and conjugate strain rates; see :mod:`standard_cones`.

    Attributes:
        numbers: Index of the cone of each point of this rank, shape (count,).
        radii: Yield radius γ (stress) of the points of this rank, ∞ in elastic bodies, shape
            (count,).
        profile: Spatially varying factor of γ, shape (count,); None if no strength varies.
        slopes: Slope α, shape (count,).
        tilts: Tilt t, shape (count, m); None if all tilts are zero.
        sets: Yield sets at points without a second-order cone.
        isotropic: Whether the coordinates are the trace and the deviator at all points.
        normal: Number of normal stresses in the equations, two in plane strain.
        among: Indices of the Mandel components in the equations.
        frames: Frames of the cones.
    """

    def __init__(self, problem: Problem, cones: BodyCones | None = None) -> None:
        """Read the cones of the laws. Collective.

        Args:
            problem: The bodies and the points.
            cones: Cones of the bodies; by default the cones of the stress components in the
                equations.

        Raises:
            InputError: If the interior point method does not support a body's yield set.
        """
        self._cones = cones = cones or body_cones(problem)
        self.isotropic, self.normal = cones.isotropic, cones.normal
        self._size = problem.S.dofmap.index_map_bs
        self.among = [0, 1, 3] if cones.normal == 2 else list(range(self._size))
        points = problem.Q.dofmap.list[: len(cones.of_cells)]
        self.numbers: Longs = np.zeros(problem.Q.dofmap.index_map.size_local, dtype=np.int64)
        self.numbers[points] = cones.of_cells[:, None]
        self.radii, self.slopes, self.tilts = cones.at(self.numbers)
        if self.tilts is not None:
            self.tilts = np.pad(self.tilts, ((0, 0), (0, self._size - self.tilts.shape[1])))
        self.profile, steepness = strengths_at_points(problem, self.numbers)
        if steepness is not None:
            self.slopes = self.slopes * steepness
        if self.profile is not None:
            self.radii = self.radii * self.profile
        self.sets = cones.sets_at(self.numbers, self.profile)
        self.frames = StressFrames(cones, self.numbers, self._size)

    def sets_of(self, copies: int) -> tuple[PointSets, ...]:
        """Return the sets at ``copies`` consecutive copies of all points."""
        profile = None if self.profile is None else np.tile(self.profile, copies)
        return self._cones.sets_at(np.tile(self.numbers, copies), profile)

    def rates(self, e: Floats) -> tuple[Floats, Floats]:
        """Return the coordinates ε' of strain rates ``e``, shapes (count,) and (count, m).

        The method may overwrite ``e``.
        """
        if not self.isotropic:
            return self.frames.rates(e[:, self.among])
        sums = e[:, :3].sum(axis=1)
        e[:, : self.normal] -= sums[:, None] / self.normal
        return sums, e

    def working(self, pressure: Floats, deviator: Floats, out: Floats) -> None:
        """Set ``out`` to Mandel vectors that do the work of σ on strain rates, shape (count, m).

        In plane strain, the out-of-plane component does no work. This component is p in isotropic
        coordinates, and zero otherwise.
        """
        if self.isotropic:
            out[:] = deviator
            out[:, :3] += pressure[:, None]
        else:
            out[:] = 0.0
            out[:, self.among] = self.frames.stresses(pressure, deviator)

    def whole(self, pressure: Floats, deviator: Floats) -> Floats:
        """Return σ as Mandel vectors, shape (count, m).

        The out-of-plane stress takes its most favourable value.
        """
        stress = np.empty((len(pressure), self._size))
        self.working(pressure, deviator, stress)
        return self.frames.whole(stress[:, self.among])


COUNT = 6
"""Number of coefficients of a quadratic function in a triangle."""

PARTS = 8
"""Number of parts of each edge of a cell for the integrals of B_i/r."""


def has_coefficients(problem: Problem) -> bool:
    """Return whether the points of a problem are Bernstein coefficients. Not collective."""
    by_flux = isinstance(problem.kinematics, RingFlux)
    return by_flux and problem.Q.dofmap.dof_layout.num_dofs == COUNT


def nodes_of_cells(problem: Problem, count: int) -> tuple[Ints, Ints]:
    """Return the nodes of cells: first at the vertices, then on the opposite edges.

    Args:
        problem: A problem with quadratic elements on triangles.
        count: Number of cells; the function uses the first ``count`` cells.

    Returns:
        Local node numbers, shape (count, 6); the positions of these nodes in the node list of a
        cell, shape (6,).
    """
    layout = problem.V.dofmap.dof_layout
    columns = [layout.entity_dofs(of, i)[0] for of in (0, 1) for i in range(3)]
    return problem.V.dofmap.list[:count][:, columns], np.array(columns, dtype=np.int32)


class RingCoefficients:
    """Strain rates q_i/ρ_i of velocities v = ru; see :class:`Rates` for the methods.

    Attributes:
        weights: Weights of the points, shape (count,); the weight of a point on the axis is 2π
            times a sixth of its cell's area.
        on_axis: Flags of the points on the axis, where strain rates are zero, shape (count,).
    """

    def __init__(self, problem: Problem) -> None:
        """Compute the matrices of the cells. Not collective."""
        self._problem, self._sums = problem, fem.Function(problem.V)
        cells, places = corners(problem.tagged_mesh.mesh)
        x = places[cells]
        self._points = problem.Q.dofmap.list[: len(cells)]
        self._nodes, self._columns = nodes_of_cells(problem, len(cells))
        rho = coefficients_of_radius(x)
        off = rho > 0
        units = np.eye(2 * COUNT).reshape(-1, 1, COUNT, 2)
        rates = [ring_rates(x, np.repeat(unit, len(x), axis=0)) for unit in units]
        self._matrices = np.stack(rates, axis=-1) / np.where(off, rho, np.inf)[..., None, None]
        _, areas = gradients(x)
        count = problem.Q.dofmap.index_map.size_local
        self.weights: Floats = np.zeros(count)
        over_radius, parts = np.zeros_like(rho), equal_parts(PARTS)  # upper bounds on ∫ B_i/r
        for part in parts:
            weights = weights_of_rates(x[..., 0] @ part.T, areas / len(parts))
            over_radius += weights @ of_parts(np.eye(COUNT)[None], part[None])[0]
        whole = 2 * math.pi * np.where(off, rho * over_radius, areas[:, None] / COUNT)
        self.weights[self._points] = whole
        self.on_axis: PairFlags = np.zeros(count, dtype=np.bool_)
        self.on_axis[self._points] = ~off

    def of(self, v: fem.Function) -> Floats:
        """See :meth:`point_strains.Rates.of`."""
        values = v.x.array.reshape(-1, 2)[self._nodes].reshape(len(self._nodes), -1)
        found = np.zeros((len(self.weights), 4), order="F")
        found[self._points] = np.einsum("cpij,cj->cpi", self._matrices, values)
        return found

    def forces(self, stress: Floats, out: PETSc.Vec) -> None:
        """See :meth:`point_strains.Rates.forces`."""
        weighted = (self.weights[:, None] * stress)[self._points]
        parts = np.einsum("cpij,cpi->cj", self._matrices, weighted, optimize=True)
        sums = self._sums.x.array.reshape(-1, 2)
        sums[:] = 0.0
        np.add.at(sums, self._nodes, parts.reshape(-1, COUNT, 2))
        self._sums.x.scatter_reverse(la.InsertMode.add)
        sums[self._problem.fixed] = 0.0
        out.array[:] = self._sums.x.array[: out.getLocalSize()]

    def of_unknowns(self) -> Floats:
        """See :meth:`point_strains.Rates.of_unknowns`."""
        found = np.zeros_like(self._matrices).reshape(*self._matrices.shape[:3], COUNT, 2)
        found[:, :, :, self._columns] = self._matrices.reshape(found.shape)
        return found.reshape(self._matrices.shape)


class Rates(Protocol):
    """Strain rates of nodal velocities at the points of a problem, and their transpose.

    Attributes:
        weights: Volume of each point of this rank, shape (count,).
        on_axis: Flags of the points at which strain rates are zero for all velocities, shape
            (count,).
    """

    weights: Floats
    on_axis: PairFlags

    def of(self, v: fem.Function) -> Floats:
        """Return ε(v) as Mandel vectors, shape (count, m), for v with up-to-date ghosts.

        Collective.

        The array stores each component contiguously.
        """
        ...

    def forces(self, stress: Floats, out: PETSc.Vec) -> None:
        """Set ``out`` to Σ w σ:ε(v) for all nodal v, zero at supports. Collective.

        Args:
            stress: Mandel vectors, shape (count, m).
            out: Vector of nodal unknowns.
        """
        ...

    def of_unknowns(self) -> Floats:
        """Return ε for each unit nodal unknown in each cell that this rank owns. Collective.

        Returns:
            Shape (num_cells, num_points, m, num_unknowns).
        """
        ...


class RatesAtPoints:
    """Strain rates at quadrature points; see :class:`Rates` for the methods."""

    def __init__(self, problem: Problem) -> None:
        """Compile the expressions. Collective."""
        self._problem = problem
        self._u, self._e = fem.Function(problem.V), fem.Function(problem.S)
        self._stress = fem.Function(problem.S)
        self._places = interpolation_points(problem.S.element)
        self._strain = fem.Expression(problem.kinematics.strain(self._u), self._places)
        self._force_form = fem.form(problem.internal_form(self._stress))
        vector = create_vector(problem.Q)
        assemble_force(vector, fem.form(ufl.TestFunction(problem.Q) * problem.dx), [])
        self.weights: Floats = vector.array_r[: problem.Q.dofmap.index_map.size_local].copy()
        vector.destroy()
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
    """Strain rates of velocities in the contact basis; see :class:`discretisation.Strains`.

    Attributes:
        rates: Strain rates of nodal velocities.
        coordinates: Coordinates of stresses and strain rates at the points.
        profile: See :class:`point_strains.PointCoordinates`.
    """

    def __init__(self, problem: Problem, cones: BodyCones | None = None) -> None:
        """Compile the expressions, and read the cones of the points. Collective.

        Args:
            problem: The bodies and the points.
            cones: See :class:`point_strains.PointCoordinates`.
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
        """Return the trace and the deviator of ε(Ty). Collective.

        Returns:
            Shapes (count,) and (count, m).
        """
        self._problem.basis.T.mult(y, self._u.x.petsc_vec)
        self._u.x.scatter_forward()
        return self.of_function(self._u)

    def of_function(self, v: fem.Function) -> tuple[Floats, Floats]:
        """Return the trace and the deviator of ε(v), for v with up-to-date ghosts. Collective."""
        return self.coordinates.rates(self.rates.of(v))

    def power_rates(self, v: fem.Function) -> Floats:
        """Return ε(v) for computing power, as Mandel vectors, shape (count, m).

        Collective.

        If the coordinates are the trace and the deviator, the result omits the volume change of
        bodies that preserve their volume, because this change is a rounding error.

        Args:
            v: Admissible velocity with updated ghosts.
        """
        if not self.coordinates.isotropic:
            return self.rates.of(v)
        sums, e = self.of_function(v)
        e[:, : self.gdim] += (np.where(self.slopes > 0, sums, 0.0) / self.gdim)[:, None]
        return e

    def nodal(self) -> Iterator[Floats]:
        """Yield the strain rates for each unit nodal unknown in this rank's cells. Collective.

        Yields:
            Trace and deviator, shape (num_cells, num_points, 1 + m), zero for supported unknowns.
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
        rates = np.stack(list(self.nodal()), axis=-1)
        both = np.broadcast_arrays(rows[..., None], unknowns[:, None, None])
        shape = self.count * parts, problem.basis.T.getSize()[0]
        places = tuple(it.ravel() for it in both)
        found = sparse.csr_array((rates.ravel(), places), shape=shape)
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
    """Return the contact forces in equilibrium with a stress and the loads. Collective.

    If the points are not Bernstein coefficients, the function returns the result of
    :func:`~perfplast_fenicsx.problem.judged.certificate.contact_forces`.

    Args:
        problem: The bodies and their loads.
        stress: Stress as Mandel vectors at the points.
        zeta: Load factor ζ.
        times: Factor of the constant loads.
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
