"""Collect the facets of surfaces in contact, with the nodes of a velocity on them."""

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from dolfinx.mesh import exterior_facet_indices

from perfplast_fenicsx.arrays import Floats, Ints, PairFlags
from perfplast_fenicsx.compat import geometry_dofmap
from perfplast_fenicsx.mesh.straight_geometry import gradients
from perfplast_fenicsx.problem.once import once_a_problem
from perfplast_fenicsx.problem.problem import Problem


@dataclass(frozen=True, eq=False)
class ContactFacets:
    """Contact facets of this rank's cells, ghosts too, of dimension d − 1.

    Attributes:
        nodes: Nodes of each facet, its vertices first, shape (num_facets, num_nodes).
        middles: Columns of ``nodes`` at the midpoints of edges, in the order of pairs of vertices,
            shape (num_facets, num_edges); no columns for linear elements.
        cells: Cells of the facets.
        sides: Local vertex opposite to each facet.
        areas: Areas, around an axis those of the full turn of the facets' midpoints; 0 where
            another rank owns the cell.
        normals: Unit normals out of the cells, shape (num_facets, d).
        tags: Tags of the surfaces.
    """

    nodes: Ints
    middles: Ints
    cells: Ints
    sides: Ints
    areas: Floats
    normals: Floats
    tags: Ints

    def edges(self, chosen: PairFlags | slice = slice(None)) -> Ints:
        """Return midside node and end nodes of each edge of chosen facets, shape (num_edges, 3)."""
        nodes, middles = self.nodes[chosen], self.middles[chosen]
        d = self.normals.shape[1]
        between = np.take_along_axis(nodes, middles, axis=1)
        found: list[Ints] = [np.zeros((0, 3), dtype=np.int32)]
        for (a, b), at in zip(combinations(range(d), 2), between.T, strict=False):
            found.append(np.column_stack([at, nodes[:, a], nodes[:, b]]))
        edges: Ints = np.unique(np.concatenate(found), axis=0)
        return edges


@once_a_problem
def contact_facets(problem: Problem) -> ContactFacets:
    """Return the contact facets. Collective."""
    V, tagged_mesh = problem.V, problem.tagged_mesh
    topology = V.mesh.topology
    tdim = topology.dim
    topology.create_connectivity(tdim - 1, tdim)
    topology.create_connectivity(tdim, tdim - 1)
    tags = tagged_mesh.facet_tags
    touching = np.isin(tags.values, problem.contact_tags)
    touching &= np.isin(tags.indices, exterior_facet_indices(topology))
    facets = tags.indices[touching]
    to_cell = topology.connectivity(tdim - 1, tdim)
    to_facet = topology.connectivity(tdim, tdim - 1).array.reshape(-1, tdim + 1)
    cells = to_cell.array[to_cell.offsets[facets]]
    sides = np.argmax(to_facet[cells] == facets[:, None], axis=1)
    layout = V.dofmap.dof_layout
    closure = np.array([layout.entity_closure_dofs(tdim - 1, i) for i in range(tdim + 1)])
    nodes: Ints = V.dofmap.list[cells[:, None], closure[sides]]
    vertices = geometry_dofmap(V.mesh)[cells][:, : tdim + 1]
    slopes, volumes = gradients(V.mesh.geometry.x[vertices][..., :tdim])
    inward = slopes[np.arange(len(cells)), sides]
    steepness = np.linalg.norm(inward, axis=1)
    owned = cells < topology.index_map(tdim).size_local
    middles = V.tabulate_dof_coordinates()[nodes, :tdim].mean(axis=1)
    around = problem.kinematics.around(middles)
    return ContactFacets(
        nodes=nodes,
        middles=_middles(V.tabulate_dof_coordinates()[nodes], tdim),
        cells=cells,
        sides=sides,
        areas=np.where(owned, tdim * volumes * steepness * around, 0.0),
        normals=-inward / steepness[:, None],
        tags=tags.values[touching],
    )


def _middles(x: Floats, tdim: int) -> Ints:
    """Return the columns of the nodes between each two vertices.

    Args:
        x: Coordinates of the nodes of facets, shape (num_facets, num_nodes, 3).
        tdim: Dimension of the mesh.
    """
    pairs = list(combinations(range(tdim), 2))
    found = np.zeros((len(x), len(pairs) if x.shape[1] > tdim else 0), dtype=np.int32)
    for column, (a, b) in enumerate(pairs[: found.shape[1]]):
        off = x[:, tdim:] - (x[:, a] + x[:, b])[:, None] / 2
        found[:, column] = tdim + np.argmin(np.linalg.norm(off, axis=2), axis=1)
    return found
