"""Find the bodies of a mesh as connected sets of cells, with their names and rigid motions."""

from collections import Counter
from dataclasses import dataclass

from mpi4py import MPI

import numpy as np
from dolfinx import fem, la
from dolfinx.common import IndexMap
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from perfplast_fenicsx.arrays import Floats, Ints
from perfplast_fenicsx.mesh.kinematics import Kinematics
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.parallel import bounding_box
from perfplast_fenicsx.rounding import ROUNDING


@dataclass(frozen=True)
class Bodies:
    """The connected components of a mesh.

    Attributes:
        count: Number of bodies on all ranks.
        of_node: Index of the body of each local (owned and ghost) block dof, shape (num_nodes,).
        centre: Centre of the box around all bodies, shape (3,).
        size: Diagonal of the box around all bodies (length).
        gdim: Geometric dimension.
        kinematics: The meaning of the coordinates, which defines the rigid motions.
    """

    count: int
    of_node: Ints
    centre: Floats
    size: float
    gdim: int
    kinematics: Kinematics

    @property
    def num_modes(self) -> int:
        """Return the number of rigid motions: 6 in 3D, 3 in the plane, 1 in axisymmetry."""
        return len(self.kinematics.motions)

    def rigid_modes(self, x: Floats) -> Floats:
        """Return unit rigid motions at points: translations, then rotations about the centre.

        Args:
            x: Points, shape (n, 3).

        Returns:
            Displacements, shape (n, gdim, num_modes).
        """
        r = (x - self.centre) / self.size
        return self.kinematics.rigid_modes(np.asarray(r, dtype=np.float64))

    def functionals(
        self,
        body: Ints,
        x: Floats,
        rows: Floats,
    ) -> Floats:
        """Return the values of ``rows``·u(x) for the unit rigid motions of all bodies.

        Args:
            body: The body of each displacement, shape (n,).
            x: Points, shape (n, 3).
            rows: Coefficients of the displacement, shape (n, gdim).

        Returns:
            Values of the functionals, shape (n, count * num_modes).
        """
        values = np.einsum("ni,nim->nm", rows, self.rigid_modes(x))
        columns = body[:, None] * self.num_modes + np.arange(self.num_modes)
        out = np.zeros((len(x), self.count * self.num_modes))
        np.put_along_axis(out, columns, values, axis=1)
        return out


def find_bodies(V: fem.FunctionSpace, kinematics: Kinematics) -> Bodies:
    """Return the bodies of the mesh of ``V``. Collective."""
    comm = V.mesh.comm
    count, of_node = components(comm, V.dofmap.index_map, V.dofmap.list)
    x = V.tabulate_dof_coordinates()
    low, high = bounding_box(comm, x)
    size = float(np.linalg.norm(high - low))
    return Bodies(count, of_node, (low + high) / 2, size, V.mesh.geometry.dim, kinematics)


def components(comm: MPI.Intracomm, index_map: IndexMap, cells: Ints) -> tuple[int, Ints]:
    """Return the number of connected components, and the component of each entity. Collective.

    Each rank finds the components of its cells. A ghost connects its component on this rank to its
    component on the owner's rank. The ranks exchange only these few connections.

    Args:
        comm: The ranks.
        index_map: Index map of the entities: nodes, or facets.
        cells: Local indices of the entities that each local cell joins, shape (num_cells, n).

    Returns:
        The number of components, and the component of each local entity, including ghosts.
    """
    num_nodes = index_map.size_local + index_map.num_ghosts
    rows = np.repeat(cells[:, 0], cells.shape[1])
    ones = np.ones(cells.size, dtype=np.int8)
    graph = coo_array((ones, (rows, cells.reshape(-1))), shape=(num_nodes, num_nodes))
    pieces, piece = connected_components(graph, directed=False)

    first = comm.exscan(pieces) or 0
    mine = first + piece.astype(np.int64)
    owners = la.vector(index_map, 1, dtype=np.int64)
    owners.array[:] = mine
    owners.scatter_forward()
    ties = np.unique(np.stack([mine, owners.array], axis=1), axis=0)
    ends = np.concatenate(comm.allgather(ties))
    total = comm.allreduce(pieces)
    joined = coo_array(
        (np.ones(len(ends), dtype=np.int8), (ends[:, 0], ends[:, 1])), (total, total)
    )
    count, body = connected_components(joined, directed=False)
    return int(count), body[mine].astype(np.int32)


def body_names(V: fem.FunctionSpace, tagged_mesh: TaggedMesh, bodies: Bodies) -> list[str]:
    """Return a name for each body; the names are the same on every rank. Collective.

    Args:
        V: Displacement space.
        tagged_mesh: Mesh with names.
        bodies: The bodies of the mesh.

    Returns:
        Names such as "'pin'". The centre of the body is added if several bodies have the same name,
        as in "'bolts' about (0.5, 2.5)". If volumes with several names form one body, its name
        contains all of them.
    """
    topology, tags = tagged_mesh.mesh.topology, tagged_mesh.cell_tags
    owned = tags.indices < topology.index_map(topology.dim).size_local
    body = bodies.of_node[V.dofmap.list[tags.indices[owned], 0]]
    own = np.unique(np.stack([body, tags.values[owned]], axis=1), axis=0)
    found = np.unique(np.concatenate(V.mesh.comm.allgather(own)), axis=0)
    named = {tag: name for name, tag in tagged_mesh.volumes.items()}
    called = [
        " and ".join(sorted(f"'{named[tag]}'" for tag in found[found[:, 0] == number, 1]))
        for number in range(bodies.count)
    ]
    several = Counter(called)
    x = V.tabulate_dof_coordinates()[:, : bodies.gdim]
    for number, name in enumerate(called):
        if several[name] > 1:
            low, high = bounding_box(V.mesh.comm, x[bodies.of_node == number])
            middle = (low + high) / 2
            middle[np.abs(middle) < ROUNDING * np.linalg.norm(high - low)] = 0.0
            place = ", ".join(f"{a:.4g}" for a in middle)
            called[number] = f"{name} about ({place})"
    return called
