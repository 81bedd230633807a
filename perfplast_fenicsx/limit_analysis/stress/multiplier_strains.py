"""Strain rates of the multipliers of equilibrium at the vertices of stress cells, as arrays."""

from petsc4py import PETSc

import numpy as np
from scipy import sparse

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.facets.facet_velocities import FacetVelocities
from perfplast_fenicsx.limit_analysis.facets.stress_cells import cell_layout, strain_matrices


class MultiplierStrains:
    """e = W⁻¹Aᵀy of multipliers y; see :class:`discretisation.Strains`.

    A vector y has the facets' unknowns of a rank first, then the inner ones of its cells.

    Attributes:
        layout: Of a cell.
        facets: The facets' unknowns.
        num_cells: Owned cells.
        matrices: Of :func:`stress_cells.strain_matrices`.
    """

    def __init__(
        self,
        facets: FacetVelocities,
        vertices: Floats,
        axes: Floats,
        cones: tuple[Floats, Floats],
    ) -> None:
        """Compute the matrices.

        Args:
            facets: The facets' unknowns.
            vertices: Of the owned cells, shape (num_cells, d + 1, d).
            axes: Of the facets' components, zero where held, shape (num_cells, d + 1, d, d).
            cones: γ and α of each cell, shapes (num_cells,).
        """
        self.num_cells, corners, self.gdim = vertices.shape
        self.facets, self.layout = facets, cell_layout(corners - 1)
        self.matrices, volumes = strain_matrices(vertices, axes)
        points = volumes.shape[1]
        self.count = volumes.size
        self.size = self.matrices.shape[-1] - 1
        self.weights: Floats = volumes.ravel()
        self.radii, self.slopes = (np.repeat(of_cells, points) for of_cells in cones)
        self.rows = self.layout.rows.reshape(points, -1)
        places = (np.ones(self.rows.size), (self.rows.ravel(), np.arange(self.rows.size)))
        self._sum = sparse.csr_array(places)

    def destroy(self) -> None:
        """Give PETSc's memory back. Collective."""
        self.facets.destroy()

    def create_vector(self) -> PETSc.Vec:
        """Multipliers of zero. Collective."""
        size = self.facets.count + self.num_cells * self.layout.inner
        return PETSc.Vec().createMPI((size, None), comm=self.facets.vector.comm)

    def inner(self, array: Floats) -> Floats:
        """The part of a vector's array that belongs to the cells, shape (num_cells, inner)."""
        return array[self.facets.count :].reshape(self.num_cells, -1)

    def of(self, y: PETSc.Vec) -> tuple[Floats, Floats]:
        """Trace and deviator of e, shapes (count,) and (count, m). Collective."""
        array = y.array_r
        values = np.hstack([self.facets.gather(array[: self.facets.count]), self.inner(array)])
        e = values[:, self.rows][:, :, None] @ self.matrices
        e = e.reshape(self.count, -1)
        return e[:, 0].copy(), e[:, 1:].copy()

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
