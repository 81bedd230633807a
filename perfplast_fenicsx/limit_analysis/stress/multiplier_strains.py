"""Evaluate the strain rates of multipliers of equilibrium at the vertices of stress cells."""

from petsc4py import PETSc

import numpy as np
import numpy.typing as npt
from scipy import sparse

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.conic.second_order_cones import own_strengths
from perfplast_fenicsx.limit_analysis.discrete.body_cones import BodyCones
from perfplast_fenicsx.limit_analysis.discrete.point_strains import StressFrames
from perfplast_fenicsx.limit_analysis.discrete.strength_fields import profiles_in, steepness_in
from perfplast_fenicsx.limit_analysis.facets.facet_geometry import FacetVelocities
from perfplast_fenicsx.limit_analysis.facets.stress_cells import (
    cell_layout,
    coefficients_of_radius,
    components,
    ring_layout,
    ring_matrices,
    strain_matrices,
)


class MultiplierStrains:
    """Strain rates e = W⁻¹Aᵀy of multipliers y; see :class:`discretisation.Strains`.

    On each rank, a vector y contains the unknowns of facets, followed by the inner unknowns of
    cells.

    Attributes:
        layout: Layout of a cell.
        facets: The facets' unknowns.
        num_cells: Number of owned cells.
        matrices: Matrices of :func:`stress_cells.strain_matrices` (in axisymmetry of
            :func:`stress_cells.ring_matrices`), transformed to the coordinates of the cones. The
            matrices are zero at bare vertices, where the stress is zero and not an unknown
            (:func:`bound_body.bare_vertices`).
        idle: Flags of unknowns that belong only to bare vertices, shape (num_cells, num_rows).
        few: Flags of cells with idle unknowns, or with points on the axis, where stresses are zero.
            In such a cell, the rows of the facets may be equivalent to rows of the cell.
    """

    def __init__(
        self,
        facets: FacetVelocities,
        vertices: Floats,
        axes: Floats,
        cones: BodyCones,
        bare: npt.NDArray[np.bool_],
        around_axis: bool = False,
    ) -> None:
        """Compute the matrices.

        Args:
            facets: The facets' unknowns.
            vertices: Vertices of the owned cells, shape (num_cells, d + 1, d).
            axes: Directions of the components on facets, zero for held components, shape
                (num_cells, d + 1, d, d).
            cones: Cones of the bodies.
            bare: Flags of the cells' vertices without stress, shape (num_cells, d + 1).
            around_axis: Whether cells are sections of rings around x = 0. In this case no vertex is
                bare.
        """
        self.num_cells, corners, self.gdim = vertices.shape
        self.facets = facets
        self.layout = ring_layout() if around_axis else cell_layout(corners - 1)
        self.matrices, volumes = (ring_matrices if around_axis else strain_matrices)(vertices, axes)
        points = volumes.shape[1]
        self.count = volumes.size
        self.weights: Floats = volumes.ravel()
        of_points = np.repeat(cones.of_cells, points)
        self.radii, self.slopes, self.tilts = cones.at(of_points)
        on_axis = np.zeros(self.count, dtype=bool)
        if around_axis:
            on_axis = coefficients_of_radius(vertices).ravel() == 0
        self.radii[on_axis], self.slopes[on_axis] = np.inf, 0.0  # S is zero there
        profile, steepness = self._fields(cones, vertices)
        if profile is not None:
            self.radii = self.radii * profile
        if steepness is not None:
            self.slopes = self.slopes * steepness
        self.sets = cones.sets_at(np.where(on_axis, -1, of_points), profile)
        self._frames = StressFrames(cones, of_points)
        self.size = self._frames.size
        # Matrices in the frames of isotropic cones would be equal up to rounding. On some meshes of
        # few cells, this rounding decides whether a stress in equilibrium is found.
        self._isotropic = cones.isotropic and not around_axis
        if not self._isotropic:
            self.matrices = self._in_frames(cones, around_axis)
        self.rows = self.layout.rows.reshape(points, -1)
        places = (np.ones(self.rows.size), (self.rows.ravel(), np.arange(self.rows.size)))
        self._sum = sparse.csr_array(places)
        self._leave(bare)
        few = self.idle.any(axis=1) | on_axis.reshape(self.num_cells, points).any(axis=1)
        self.few: npt.NDArray[np.bool_] = np.asarray(few)

    def _fields(self, cones: BodyCones, vertices: Floats) -> tuple[Floats | None, Floats | None]:
        """Return lower bounds on profiles and slope factors at the points, or None if constant."""
        if not cones.varies:
            return None, None
        places = np.concatenate([vertices, vertices.mean(axis=1, keepdims=True)], axis=1)
        parts = places[:, self.layout.corners]
        numbers = np.repeat(cones.of_cells, parts.shape[1])
        parts = parts.reshape(-1, *parts.shape[2:])
        profile = profiles_in(cones, numbers, parts, "below")
        steepness = steepness_in(cones, numbers, parts, "below")
        if profile is not None:
            profile = profile.ravel()
        if steepness is not None:
            steepness = np.repeat(steepness, parts.shape[1])
        return profile, steepness

    def _leave(self, bare: npt.NDArray[np.bool_]) -> None:
        """Remove the stresses at bare vertices from the unknowns, and find the idle multipliers."""
        before = self._unused()
        if bare.any():
            ends = np.column_stack([bare, np.zeros(len(bare), dtype=bool)])  # the barycentre
            there = ends[:, self.layout.corners].reshape(self.num_cells, -1)
            self.matrices[there] = 0.0
            of_points = there.ravel()
            self.radii[of_points], self.slopes[of_points] = np.inf, 0.0
            if self.tilts is not None:
                self.tilts[of_points] = 0.0
            self.sets = tuple(it.those(~of_points[it.at]) for it in self.sets)
        self.idle: npt.NDArray[np.bool_] = self._unused() & ~before

    def _unused(self) -> npt.NDArray[np.bool_]:
        """Return flags of a cell's multipliers that act on no stress, (num_cells, num_rows)."""
        sizes = np.abs(self.matrices).sum(axis=3).reshape(self.num_cells, -1)
        unused: npt.NDArray[np.bool_] = (self._sum @ sizes.T).T == 0
        return unused

    def weaknesses(self, pressure: Floats) -> Floats:
        """Return 1/strength at the weakest point of each cell, shape (num_cells,).

        Args:
            pressure: Mean stress p (stress) at the points; values at further points may follow.
                Without cohesion, the strength depends on p.
        """
        own = own_strengths(self, pressure[: self.count])
        found: Floats = (1 / own).reshape(self.num_cells, -1).max(axis=1)
        return found

    def _in_frames(self, cones: BodyCones, around_axis: bool) -> Floats:
        """Return the matrices in the coordinates of the cones."""
        found = np.empty((*self.matrices.shape[:-1], self.size + 1))
        basis = np.eye(self.matrices.shape[-1]) if around_axis else components(self.gdim)
        for number, F in enumerate(self._frames.frames):
            here = cones.of_cells == number
            to_frame = basis / (basis**2).sum(axis=1, keepdims=True) @ F
            found[here] = self.matrices[here] @ to_frame
        return found

    def whole(self, pressure: Floats, deviator: Floats) -> Floats:
        """Return σ as Mandel vectors, shape (count, 4 or 6).

        The out-of-plane stress takes its most favourable value.
        """
        if self._isotropic:
            stress = np.column_stack([pressure, deviator]) @ components(self.gdim)
            return self._frames.whole(stress)
        return self._frames.whole(self._frames.stresses(pressure, deviator))

    def destroy(self) -> None:
        """Free PETSc's memory. Collective."""
        self.facets.destroy()

    def create_vector(self) -> PETSc.Vec:
        """Return a vector of zero multipliers. Collective."""
        size = self.facets.count + self.num_cells * self.layout.inner
        return PETSc.Vec().createMPI((size, None), comm=self.facets.vector.comm)

    def inner(self, array: Floats) -> Floats:
        """Return the inner unknowns of cells as a view of a vector's array.

        The result has the shape (num_cells, inner).
        """
        return array[self.facets.count :].reshape(self.num_cells, -1)

    def of(self, y: PETSc.Vec) -> tuple[Floats, Floats]:
        """Return the trace and the deviator of e, shapes (count,) and (count, m). Collective."""
        array = y.array_r
        values = np.hstack([self.facets.gather(array[: self.facets.count]), self.inner(array)])
        e = values[:, self.rows][:, :, None] @ self.matrices
        e = e.reshape(self.count, -1)
        return e[:, 0].copy(), e[:, 1:].copy(order="F")

    def matrix(self) -> sparse.csr_array:
        """See :meth:`discretisation.Strains.matrix`."""
        outer = np.arange(self.num_cells * self.layout.outer).reshape(self.num_cells, -1)
        inner = np.arange(self.num_cells * self.layout.inner).reshape(self.num_cells, -1)
        of_cells = sparse.block_diag((self.facets.matrix(), sparse.eye_array(inner.size)))
        columns = np.hstack([outer, outer.size + inner])[:, self.rows]
        to = np.arange(self.count * (1 + self.size)).reshape(*columns.shape[:2], 1, -1)
        both = np.broadcast_arrays(to, columns[..., None])
        at_points = (self.matrices.ravel(), tuple(it.ravel() for it in both))
        shape = self.count * (1 + self.size), outer.size + inner.size
        return sparse.csr_array(at_points, shape=shape) @ of_cells

    def deviators(self, deviator: Floats) -> Floats:
        """Return the deviator unchanged, because it has no redundant component."""
        return deviator

    def forces(self, pressure: Floats, deviator: Floats, out: PETSc.Vec) -> None:
        """Set ``out`` to Aσ. Collective."""
        stress = np.column_stack([pressure, deviator]) * self.weights[:, None]
        stress = stress.reshape(self.num_cells, -1, self.size + 1, 1)
        pushes = (self.matrices @ stress).reshape(self.num_cells, -1)
        forces: Floats = (self._sum @ pushes.T).T
        outer = self.layout.outer
        array = out.array
        array[: self.facets.count] = self.facets.add_up(np.ascontiguousarray(forces[:, :outer]))
        array[self.facets.count :] = forces[:, outer:].ravel()
