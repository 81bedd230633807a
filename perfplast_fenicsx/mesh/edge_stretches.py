"""Lengthen edges of a mesh virtually where a field changes along them.

Slip bands are thin: cells must be small across them, but not along them. So edges along which
fields change are cut first, and others later.
"""

import numpy as np
from dolfinx import la
from dolfinx.mesh import Mesh

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.mesh.bisection import edges_of_simplex
from perfplast_fenicsx.mesh.straight_geometry import corners


def edge_stretches(mesh: Mesh, gradients: Floats) -> Floats:
    """Return factors of the lengths of local edges, the same on all ranks. Collective.

    A factor is 1/2 plus the change along the edge relative to its largest possible value for the
    size of the gradients, averaged over the surrounding cells. So cells become up to about three
    times as long as they are wide.

    Args:
        mesh: Mesh of tetrahedra with straight sides.
        gradients: Gradients of any fields, constant in each owned cell, ∂f_j/∂x_i in row i, shape
            (num_cells, 3, m).

    Returns:
        Factors, shape (num_edges,), 0.5 to 1.5.
    """
    topology = mesh.topology
    topology.create_entities(1)
    topology.create_connectivity(3, 1)
    owned, edges = len(gradients), topology.index_map(1)
    of_cell = topology.connectivity(3, 1).array.reshape(-1, 6)[:owned].ravel()
    cells, points = corners(mesh)
    x = points[cells[:owned]]
    ends = edges_of_simplex(3)
    along = x[:, ends[:, 1]] - x[:, ends[:, 0]]
    sizes = np.linalg.norm(gradients, axis=(1, 2))[:, None]
    volumes = np.abs(np.linalg.det(x[:, 1:] - x[:, :1]))[:, None]
    changes = np.linalg.norm(along @ gradients, axis=2) * volumes
    most = np.linalg.norm(along, axis=2) * volumes * sizes

    sums = la.vector(edges, 2, dtype=np.float64)
    table = sums.array.reshape(edges.size_local + edges.num_ghosts, 2)
    np.add.at(table, of_cell, np.column_stack([changes.ravel(), most.ravel()]))
    sums.scatter_reverse(la.InsertMode.add)
    sums.scatter_forward()
    share = np.divide(table[:, 0], table[:, 1], out=np.zeros(len(table)), where=table[:, 1] > 0)
    digits = 3  # rounded, so that equal edges have equal factors in any order of summation
    stretches: Floats = 0.5 + np.round(share, digits)
    return stretches
