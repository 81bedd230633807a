"""Find vertices of a mesh that coincide where its bodies are in contact."""

from collections.abc import Sequence

import numpy as np
from dolfinx import fem

from perfplast_fenicsx.arrays import Longs
from perfplast_fenicsx.contact.declared.contact import Contact
from perfplast_fenicsx.contact.declared.tie import Tie
from perfplast_fenicsx.contact.surfaces.gap_function import MATCHING_TOLERANCE
from perfplast_fenicsx.contact.surfaces.node_matching import match_nodes
from perfplast_fenicsx.contact.surfaces.surface_nodes import extent, surface_nodes
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh


def opposite_vertices(tagged_mesh: TaggedMesh, contacts: Sequence[Contact | Tie]) -> Longs:
    """Return pairs of vertices that coincide, or that are opposite each other across a gap.

    Collective.

    Args:
        tagged_mesh: The bodies.
        contacts: Their contacts or ties; for surfaces that do not match, only the matching vertices
            count.

    Returns:
        Global numbers of vertices, shape (num_pairs, 2); each pair is on exactly one rank.
    """
    comm, topology = tagged_mesh.mesh.comm, tagged_mesh.mesh.topology
    V = fem.functionspace(tagged_mesh.mesh, ("Lagrange", 1, (topology.dim,)))
    nodes = V.dofmap.index_map.size_local + V.dofmap.index_map.num_ghosts
    fixed = np.zeros((nodes, topology.dim), dtype=np.bool_)
    vertices = topology.connectivity(topology.dim, 0).array
    number = np.empty(nodes, dtype=np.int64)
    number[V.dofmap.list.ravel()] = topology.index_map(0).local_to_global(vertices)
    pairs = [np.empty((0, 2), dtype=np.int64)]
    for contact in contacts:
        one, other = (
            surface_nodes(V, tagged_mesh, name, fixed)
            for name in (contact.primary, contact.secondary)
        )
        for rows in (one, other):
            rows["number"] = number[rows["node"]]
        size = extent(comm, np.concatenate([one["x"], other["x"]]))
        found = match_nodes(comm, one, other, MATCHING_TOLERANCE * size)
        pairs.append(np.column_stack([found.primary["number"], found.secondary["number"]]))
    return np.concatenate(pairs)
