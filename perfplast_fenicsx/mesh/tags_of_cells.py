"""Convert tags of cells and of their facets to arrays with a row for each cell, and back."""

import numpy as np
from dolfinx.mesh import Mesh, MeshTags, meshtags

from perfplast_fenicsx.arrays import Ints
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh

UNNAMED = np.iinfo(np.int32).min


def values_of(tags: MeshTags, count: int) -> Ints:
    """Return the tag of each of the first local entities; ``UNNAMED`` without a tag."""
    values = np.full(max(count, tags.indices.max(initial=-1) + 1), UNNAMED, dtype=np.int32)
    values[tags.indices] = tags.values
    return values[:count]


def facet_tags_of(tagged_mesh: TaggedMesh, owned: int) -> Ints:
    """Return tags of the facets of the first cells, shape (owned, dim + 1).

    The first call is collective.
    """
    topology = tagged_mesh.mesh.topology
    dim = topology.dim
    topology.create_connectivity(dim, dim - 1)
    facets = topology.index_map(dim - 1)
    tags = values_of(tagged_mesh.facet_tags, facets.size_local + facets.num_ghosts)
    of_cell: Ints = tags[topology.connectivity(dim, dim - 1).array.reshape(-1, dim + 1)[:owned]]
    return of_cell


def cell_meshtags(mesh: Mesh, values: Ints) -> MeshTags:
    """Return the tags of all local cells, shape (num_cells,)."""
    return meshtags(mesh, mesh.topology.dim, np.arange(len(values), dtype=np.int32), values)


def facet_meshtags(mesh: Mesh, of_cell: Ints) -> MeshTags:
    """Return tags of facets given by cell, as from :func:`facet_tags_of`. Collective."""
    dim = mesh.topology.dim
    mesh.topology.create_connectivity(dim, dim - 1)
    mesh.topology.create_connectivity(dim - 1, dim)
    facets = mesh.topology.connectivity(dim, dim - 1).array
    values = of_cell.ravel()
    named = values != UNNAMED
    found, at = np.unique(facets[named], return_index=True)
    return meshtags(mesh, dim - 1, found, values[named][at])
