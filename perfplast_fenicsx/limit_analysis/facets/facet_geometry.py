"""Compute coordinates and normals of a rank's outer facets, in the local numbering of bounds."""

import numpy as np
from dolfinx.mesh import exterior_facet_indices

from perfplast_fenicsx.arrays import Floats, Ints, Longs
from perfplast_fenicsx.limit_analysis.facets.facet_velocities import FacetNumbers
from perfplast_fenicsx.mesh.straight_geometry import gradients
from perfplast_fenicsx.problem.problem import Problem


class FacetGeometry:
    """Geometry of the exterior facets of this rank, by local number.

    Attributes:
        exterior: Local numbers of the facets that it owns, sorted.
        cell: Cell of each facet, ghosts too, shape (num_facets,).
        side: Vertex of the cell opposite to the facet, shape (num_facets,).
        vertices: Vertices of the cells, shape (num_cells, d + 1, d).
    """

    def __init__(self, problem: Problem, numbers: FacetNumbers, vertices: Floats) -> None:
        topology = problem.tagged_mesh.mesh.topology
        self.tdim = tdim = topology.dim
        self.index_map = topology.index_map(tdim - 1)
        self.num: int = self.index_map.size_local + self.index_map.num_ghosts
        topology.create_connectivity(tdim - 1, tdim)
        self.exterior = exterior_facet_indices(topology)
        cell, side = np.zeros(self.num, dtype=np.int64), np.zeros(self.num, dtype=np.int64)
        cells, sides = np.indices(numbers.facets.shape)
        cell[numbers.facets], side[numbers.facets] = cells, sides
        self._numbers, self.vertices, self.cell, self.side = numbers, vertices, cell, side

    def normals(self, facets: Ints | Longs) -> Floats:
        """Return outward unit normals, shape (n, d)."""
        cells = self.vertices[self.cell[facets]]
        slopes = gradients(cells)[0][np.arange(len(facets)), self.side[facets]]
        normals: Floats = -slopes / np.linalg.norm(slopes, axis=1, keepdims=True)
        return normals

    def areas(self, facets: Ints | Longs) -> Floats:
        """Return areas (lengths in the plane), shape (n,)."""
        slopes, volumes = gradients(self.vertices[self.cell[facets]])
        heights = np.linalg.norm(slopes[np.arange(len(facets)), self.side[facets]], axis=1)
        found: Floats = self.tdim * volumes * heights
        return found

    def corners(self, facets: Ints) -> Floats:
        """Return vertices of facets in the facets' own order, shape (n, d, d)."""
        tdim, cell, side = self.tdim, self.cell[facets], self.side[facets]
        others = np.array([[b for b in range(tdim + 1) if b != a] for a in range(tdim + 1)])
        x = self.vertices[cell[:, None], others[side]]
        places = self._numbers.places[cell, side]
        return np.take_along_axis(x, np.argsort(places, axis=1)[:, :, None], axis=1)

    def at_corners(self, facets: Ints, values: Floats) -> Floats:
        """Return values at vertices in the order of the cell's vertices, shape (n, d, ...).

        Args:
            facets: Numbers of facets.
            values: Values at vertices in the facets' own order, shape (n, d, ...).
        """
        places = self._numbers.places[self.cell[facets], self.side[facets]]
        return values[np.arange(len(facets))[:, None], places]

    def of(self, problem: Problem, surface: str) -> Ints:
        """Return the owned exterior facets of a surface."""
        found: Ints = np.intersect1d(problem.tagged_mesh.facets(surface), self.exterior)
        return found
