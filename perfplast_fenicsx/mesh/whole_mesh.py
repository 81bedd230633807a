"""Copy a whole distributed mesh to each rank, for independent computations."""

from dataclasses import dataclass, field

from mpi4py import MPI

import basix.ufl
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx.mesh import create_mesh

from perfplast_fenicsx.arrays import Longs
from perfplast_fenicsx.mesh.straight_geometry import corners
from perfplast_fenicsx.mesh.tagged_mesh import (
    TaggedMesh,
    cell_meshtags,
    facet_meshtags,
    facet_tags_of,
    values_of,
)


@dataclass(frozen=True, eq=False, repr=False)
class WholeMesh(TaggedMesh):
    """A copy of a distributed mesh on one rank, with all cells.

    Attributes:
        numbers: Global index of each cell in the distributed mesh, shape (num_cells,).
    """

    numbers: Longs = field(kw_only=True)


def whole_mesh(shared: TaggedMesh) -> WholeMesh:
    """Return a copy of the mesh on each rank; vertices keep their order in each cell. Collective.

    Args:
        shared: Distributed mesh of straight cells, without ghost cells.
    """
    mesh = shared.mesh
    comm, topology = mesh.comm, mesh.topology
    vertices, points = corners(mesh)
    cells, of_vertices = len(vertices), topology.index_map(0)
    local = np.arange(len(points), dtype=np.int32)
    numbers = np.asarray(of_vertices.local_to_global(local), dtype=np.int64)
    x = _of_all(comm, points[: of_vertices.size_local].astype(mesh.geometry.x.dtype))
    whole = _of_all(comm, numbers[vertices])
    bodies = _of_all(comm, values_of(shared.cell_tags, cells))
    facets = _of_all(comm, facet_tags_of(shared, cells))
    element = basix.ufl.element(
        "Lagrange", topology.cell_name(), 1, shape=(mesh.geometry.dim,), dtype=x.dtype
    )
    copy = create_mesh(MPI.COMM_SELF, whole, x=x, e=ufl.Mesh(element))
    order: Longs = np.asarray(copy.topology.original_cell_index, dtype=np.int64)
    return WholeMesh(
        mesh=copy,
        cell_tags=cell_meshtags(copy, bodies[order]),
        facet_tags=facet_meshtags(copy, facets[order]),
        volumes=shared.volumes,
        surfaces=shared.surfaces,
        section=shared.section,
        remarks=shared.remarks,
        taken=shared.taken,
        numbers=order,
    )


def to_owners(
    shared: TaggedMesh, copy: WholeMesh, root: int, rows: dict[str, npt.NDArray]
) -> dict[str, npt.NDArray]:
    """Send one rank's results on its copy to the ranks that own the cells. Collective.

    Args:
        shared: The distributed mesh.
        copy: The copy of the mesh on this rank.
        root: The rank that has the results.
        rows: Arrays by name with a row for each cell of the copy; only the arrays on ``root`` are
            used.

    Returns:
        Arrays by name with a row for each owned cell.
    """
    topology = shared.mesh.topology
    comm, count = shared.mesh.comm, topology.index_map(topology.dim).size_local
    ends = np.cumsum(comm.allgather(count))
    pieces = None
    if comm.rank == root:
        places = np.argsort(copy.numbers)
        pieces = [
            {name: array[places[end - size : end]] for name, array in rows.items()}
            for end, size in zip(ends, np.diff(ends, prepend=0), strict=True)
        ]
    return comm.scatter(pieces, root)


def _of_all(comm: MPI.Intracomm, rows: npt.NDArray) -> npt.NDArray:
    """Return the rows of all ranks in rank order. Collective."""
    found: npt.NDArray = np.concatenate(comm.allgather(rows))
    return found
