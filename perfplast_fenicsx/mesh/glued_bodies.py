"""Merge glued bodies with matching vertices into one body with the same cells."""

from collections.abc import Collection

import basix.ufl
import numpy as np
import ufl
from dolfinx.mesh import create_mesh, exterior_facet_indices, meshtags
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from perfplast_fenicsx.arrays import Ints, Longs
from perfplast_fenicsx.compat import sent_to
from perfplast_fenicsx.mesh.straight_geometry import corners
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh, cell_meshtags, distributed_tags


def glue(tagged_mesh: TaggedMesh, pairs: Longs, surfaces: Collection[str]) -> TaggedMesh | None:
    """Return the mesh with each pair of vertices merged into one vertex. Collective.

    Cells stay on their ranks, and names do not change, but the glued surfaces no longer have
    facets.

    Args:
        tagged_mesh: Bodies of straight cells, without ghost cells.
        pairs: Pairs of coinciding vertices by global numbers, each on any rank, shape (num_pairs,
            2).
        surfaces: Names of the glued surfaces.

    Returns:
        The mesh; None if the surfaces do not match, because a facet has no opposite facet.
    """
    mesh = tagged_mesh.mesh
    comm, topology = mesh.comm, mesh.topology
    tdim, vertex_map = topology.dim, topology.index_map(0)
    vertices, points = corners(mesh)
    merged = _merged(np.concatenate(comm.allgather(pairs)))
    given = vertex_map.local_to_global(np.arange(len(points), dtype=np.int32))
    numbers = _renumbered(given, merged)
    element = basix.ufl.element(
        "Lagrange", topology.cell_name(), 1, shape=(mesh.geometry.dim,), dtype=points.dtype
    )
    here = sent_to(np.full(len(vertices), comm.rank))
    first_cell = comm.exscan(len(vertices)) or 0
    gone = merged[merged[:, 0] != merged[:, 1], 0]
    owned = given[: vertex_map.size_local]
    x = points[: vertex_map.size_local][~np.isin(owned, gone)]
    glued = create_mesh(comm, numbers[vertices], x=x, e=ufl.Mesh(element), partitioner=here)
    parents: Ints = (glued.topology.original_cell_index - first_cell).astype(np.int32)
    tags = np.zeros(len(vertices), dtype=np.int32)
    known = tagged_mesh.cell_tags.indices < len(vertices)
    tags[tagged_mesh.cell_tags.indices[known]] = tagged_mesh.cell_tags.values[known]

    topology.create_connectivity(tdim - 1, 0)
    to_vertices = topology.connectivity(tdim - 1, 0).array.reshape(-1, tdim)
    facets, values = tagged_mesh.facet_tags.indices, tagged_mesh.facet_tags.values
    mine = facets < topology.index_map(tdim - 1).size_local
    every = distributed_tags(
        glued, tdim - 1, numbers[to_vertices[facets[mine]]], values[mine].astype(np.int32)
    )
    left = np.isin(every.values, tagged_mesh.tags_of(surfaces))
    glued.topology.create_connectivity(tdim - 1, tdim)
    outside = np.isin(every.indices, exterior_facet_indices(glued.topology))
    if comm.allreduce(bool((left & outside).any())):
        return None
    return TaggedMesh(
        glued,
        cell_meshtags(glued, tags[parents]),
        meshtags(glued, tdim - 1, every.indices[~left], every.values[~left]),
        tagged_mesh.volumes,
        tagged_mesh.surfaces,
        tagged_mesh.section,
        taken=tagged_mesh.taken,
    )


def _merged(pairs: Longs) -> Longs:
    """Return the sorted numbers in ``pairs``, and the least number of each number's group."""
    numbers, at = np.unique(pairs, return_inverse=True)
    one, other = at.reshape(-1, 2).T
    graph = coo_array((np.ones(len(one)), (one, other)), shape=(len(numbers),) * 2)
    _, labels = connected_components(graph, directed=False)
    least = np.full(labels.max(initial=-1) + 1, np.iinfo(np.int64).max)
    np.minimum.at(least, labels, numbers)
    return np.column_stack([numbers, least[labels]]).astype(np.int64)


def _renumbered(numbers: Longs, merged: Longs) -> Longs:
    """Return ``numbers`` after the merging of vertices, renumbered without gaps."""
    found: Longs = numbers.copy()
    chosen = np.isin(numbers, merged[:, 0])
    found[chosen] = merged[np.searchsorted(merged[:, 0], numbers[chosen]), 1]
    gone = merged[merged[:, 0] != merged[:, 1], 0]
    return found - np.searchsorted(gone, found)
