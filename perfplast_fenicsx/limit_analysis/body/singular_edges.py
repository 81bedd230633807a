"""Find edges of a mesh in space around which the stress depends only on the direction.

In the plane across such an edge the stress is as at a singular point (:mod:`singular_points`).
Bisection adds no new directions, at any cell size. Fans of cells around the edge add directions.
"""

import numpy as np
import numpy.typing as npt
from dolfinx import la
from dolfinx.mesh import exterior_facet_indices

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.body.singular_points import kinds_of_facets, turns
from perfplast_fenicsx.mesh.bisection import edges_of_simplex
from perfplast_fenicsx.mesh.straight_geometry import corners
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.problem.declared.given import Given


def singular_edges(tagged_mesh: TaggedMesh, given: Given, valence: int) -> npt.NDArray[np.bool_]:
    """Return which edges of each owned cell need more cells around them. Collective.

    Args:
        tagged_mesh: Mesh of tetrahedra.
        given: Its loads, supports and contacts.
        valence: Required number of cells around an edge whose sides allow a rotation by a right
            angle, see :func:`singular_points.singular_points`.

    Returns:
        Flags in DOLFINx's order of edges, shape (num_cells, 6).
    """
    topology = tagged_mesh.mesh.topology
    topology.create_entities(1)
    topology.create_connectivity(3, 1)
    topology.create_connectivity(2, 1)
    topology.create_connectivity(2, 3)
    cells, points = corners(tagged_mesh.mesh)
    of_cell = topology.connectivity(3, 1).array.reshape(-1, 6)[: len(cells)]
    outer = exterior_facet_indices(topology)
    sides = topology.connectivity(2, 1).array.reshape(-1, 3)[outer]
    kind = np.repeat(kinds_of_facets(tagged_mesh, given)[outer], 3).astype(np.float64)

    edges = topology.index_map(1)
    sums = la.vector(edges, 5, dtype=np.float64)
    table = sums.array.reshape(edges.size_local + edges.num_ghosts, 5)
    angle = angles_at_edges(points[cells]).ravel()
    np.add.at(table[:, :2], of_cell.ravel(), np.column_stack([angle, np.ones(angle.size)]))
    np.add.at(table[:, 2:], sides.ravel(), np.column_stack([np.ones(kind.size), kind, kind**2]))
    sums.scatter_reverse(la.InsertMode.add)
    sums.scatter_forward()
    angles, around, facets, kinds, squares = table.T
    wanted = valence * turns(angles, facets, kinds, squares)
    wanting: npt.NDArray[np.bool_] = ((facets > 0) & (around < wanted))[of_cell]
    return wanting


def angles_at_edges(x: Floats) -> Floats:
    """Return angles between the two faces at each edge.

    Args:
        x: Corners of tetrahedra, shape (num_cells, 4, 3).

    Returns:
        Angles, shape (num_cells, 6).
    """
    ends = edges_of_simplex(3)
    others = ends[::-1]  # edge k is opposite edge 5 - k
    along = x[:, ends[:, 1]] - x[:, ends[:, 0]]
    along /= np.linalg.norm(along, axis=-1, keepdims=True)
    one, other = (
        away - np.einsum("cei,cei->ce", away, along)[..., None] * along
        for away in (x[:, others[:, k]] - x[:, ends[:, 0]] for k in (0, 1))
    )
    across = np.linalg.norm(np.cross(one, other), axis=-1)
    angles: Floats = np.arctan2(across, np.einsum("cei,cei->ce", one, other))
    return angles
