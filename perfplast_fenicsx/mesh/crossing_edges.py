"""Move inner vertices of a plane mesh where the edges of four triangles nearly form two lines.

If four triangles meet at a vertex and their edges form two straight lines, the equilibrium
conditions for a stress that is linear in each triangle are linearly dependent. If the lines are
straight up to the rounding errors of a mesh generator, the conditions are nearly dependent, and no
factorisation is accurate enough to resolve the difference.
"""

import numpy as np
import numpy.typing as npt
from dolfinx import la
from dolfinx.mesh import exterior_facet_indices

from perfplast_fenicsx.compat import entity_nodes
from perfplast_fenicsx.mesh.straight_geometry import corners
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh


def bend_crossings(tagged_mesh: TaggedMesh, stays: npt.NDArray[np.bool_] | None = None) -> int:
    """Move vertices at which edges nearly form two crossing lines; return their number. Collective.

    The function moves vertices slightly and in place. It does not move vertices on surfaces and
    boundaries, so the shapes of bodies do not change.

    Args:
        tagged_mesh: Mesh of straight triangles.
        stays: Flags of local vertices that must not move, for example because a load depends on a
            line through them.

    Returns:
        Number of moved vertices on all ranks.
    """
    mesh = tagged_mesh.mesh
    topology, comm = mesh.topology, mesh.comm
    vertices, points = corners(mesh)
    index_map = topology.index_map(0)
    count = index_map.size_local + index_map.num_ghosts
    owned = topology.index_map(2).size_local
    sums = la.vector(index_map, 8, dtype=np.float64)
    table = sums.array.reshape(count, 8)
    x = points[vertices[:owned]][..., :2]
    tags = np.zeros(owned)
    here = tagged_mesh.cell_tags.indices < owned
    tags[tagged_mesh.cell_tags.indices[here]] = tagged_mesh.cell_tags.values[here]
    for shift in (1, 2):
        ways = np.roll(x, -shift, axis=1) - x
        lengths = np.linalg.norm(ways, axis=2)
        at = vertices[:owned].ravel()
        np.add.at(table[:, :2], at, (ways / lengths[..., None]).reshape(-1, 2))
        np.add.at(table[:, 2], at, 1 / lengths.ravel())
    opposite = np.linalg.norm(np.roll(x, -1, axis=1) - np.roll(x, -2, axis=1), axis=2)
    sides = x[:, 1:] - x[:, :1]
    areas = np.abs(np.linalg.det(sides))
    np.add.at(table[:, 7], vertices[:owned].ravel(), (opposite / areas[:, None]).ravel())
    for column, values in enumerate((np.ones(owned), tags, tags**2), start=3):
        np.add.at(table[:, column], vertices[:owned].ravel(), np.repeat(values, 3))
    topology.create_connectivity(1, 2)
    topology.create_connectivity(1, 0)
    facets = np.union1d(exterior_facet_indices(topology), tagged_mesh.facet_tags.indices)
    ends = topology.connectivity(1, 0).array.reshape(-1, 2)[facets]
    table[ends.ravel(), 6] = 1.0
    sums.scatter_reverse(la.InsertMode.add)
    sums.scatter_forward()
    cells = table[:, 3]
    alike = np.abs(cells * table[:, 5] - table[:, 4] ** 2) < 0.5
    # divided by 2, because each edge belongs to two triangles
    bend = np.linalg.norm(table[:, :2], axis=1) / 2
    # the lines are straight if the sum of the four unit vectors along the edges is at most this
    # long
    rounding = 1e-13
    clear = 1e-3  # if this sum is longer, the lines are clearly bent
    nearly = (cells == 4) & alike & (table[:, 6] == 0) & (rounding < bend) & (bend < clear)
    # displacement of a vertex, relative to the harmonic mean of the lengths of its edges
    shifted = 0.05
    nearly &= True if stays is None else ~stays
    # The displacement is at most this value divided by the sum of the cells' inverse heights. This
    # sum is at least the inverse of the least height, so cells do not fold.
    within = 0.3
    far = np.minimum(
        shifted * 8 / np.maximum(table[:, 2], 1e-300), within / np.maximum(table[:, 7], 1e-300)
    )
    step = np.where(nearly, far, 0.0)
    nodes = entity_nodes(mesh, 0, np.arange(count, dtype=np.int32)).reshape(-1)
    # direction of the displacement; any direction bends at least one of the lines
    way = np.array([0.8, 0.6])
    mesh.geometry.x[nodes, :2] += step[:, None] * way
    moved: int = comm.allreduce(int(nearly[: index_map.size_local].sum()))
    return moved
