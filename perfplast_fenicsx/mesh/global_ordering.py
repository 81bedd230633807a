"""Order cells and nodes independently of the distribution of the mesh.

Cells are numbered as in the input, nodes by the first cell that contains them and their position in
it. Files use this order: a run on any number of ranks writes the same files, and reads those of any
other run. Each rank stores a block of consecutive numbers. All-to-all communication moves values
between this block and the owners of the cells and nodes.
"""

from dataclasses import dataclass

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
from dolfinx import la
from dolfinx.common import IndexMap
from dolfinx.mesh import Mesh

from perfplast_fenicsx.arrays import Ints, Longs
from perfplast_fenicsx.parallel import exchange_rows, send_rows


class Ordering:
    """The order of entities by a key.

    Attributes:
        first: Number of the first entity in this rank's block.
        count: Number of entities in this rank's block.
        total: Number of entities on all ranks.
    """

    def __init__(self, comm: MPI.Intracomm, keys: Longs) -> None:
        """Determine the order. Collective.

        Args:
            comm: The ranks.
            keys: Keys of the entities owned by this rank, at least 0; they are unique over all
                ranks.
        """
        self._comm = comm
        width = comm.allreduce(int(keys.max(initial=0)), MPI.MAX) // comm.size + 1
        keeper = keys // width
        self._by_keeper = np.argsort(keeper, kind="stable")
        self._owned = np.bincount(keeper, minlength=comm.size)
        self._kept = np.empty_like(self._owned)
        comm.Alltoall(self._owned, self._kept)
        self._sorting = np.argsort(self._to_keepers(keys))
        self.count = len(self._sorting)
        self.first: int = comm.exscan(self.count) or 0
        self.total: int = comm.allreduce(self.count)

    def to_blocks(self, values: npt.NDArray) -> npt.NDArray:
        """Return values of owned entities, shape (n, ...), as those of this rank's block.

        Collective.
        """
        return self._to_keepers(values)[self._sorting]

    def from_blocks(self, values: npt.NDArray) -> npt.NDArray:
        """Return values of this rank's block, shape (count, ...), as those of owned entities.

        Collective.
        """
        kept = np.empty_like(values)
        kept[self._sorting] = values
        owned = np.empty((len(self._by_keeper), *values.shape[1:]), dtype=values.dtype)
        owned[self._by_keeper] = exchange_rows(self._comm, kept, self._kept, self._owned)
        return owned

    def numbers(self) -> Longs:
        """Return the numbers of the owned entities. Collective."""
        return self.from_blocks(np.arange(self.first, self.first + self.count))

    def _to_keepers(self, values: npt.NDArray) -> npt.NDArray:
        """Return rows of owned entities on the ranks that store their keys. Collective."""
        return exchange_rows(self._comm, values[self._by_keeper], self._owned, self._kept)


@dataclass(frozen=True)
class Block:
    """This rank's rows of an array.

    Attributes:
        values: Shape (count, ...), with the same other dimensions on every rank.
        first: Number of the first row.
        total: Rows on all ranks.
    """

    values: npt.NDArray
    first: int
    total: int

    @property
    def shape(self) -> tuple[int, ...]:
        """Return the shape of the whole array."""
        return (self.total, *self.values.shape[1:])


def block(ordering: Ordering, values: npt.NDArray) -> Block:
    """Return values of owned entities as this rank's block of the whole array. Collective."""
    values = np.ascontiguousarray(ordering.to_blocks(values))
    return Block(values, ordering.first, ordering.total)


def cell_ordering(mesh: Mesh) -> Ordering:
    """Return the input order of a mesh's owned cells. Collective."""
    return Ordering(mesh.comm, _input_cells(mesh))


def node_ordering(mesh: Mesh, cells: Ints, index_map: IndexMap) -> Ordering:
    """Return the order of owned nodes by their first cell. Collective.

    Args:
        mesh: The mesh.
        cells: Local nodes of each local cell, shape (num_cells, nodes_per_cell).
        index_map: Index map of the nodes, of the geometry or of displacements.
    """
    owned, per_cell = index_map.size_local, cells.shape[1]
    cells = cells[: len(_input_cells(mesh))]
    keys = _input_cells(mesh)[:, None] * per_cell + np.arange(per_cell)
    unseen = np.iinfo(np.int64).max
    least = np.full(owned + index_map.num_ghosts, unseen)
    np.minimum.at(least, cells.ravel(), keys.ravel())
    rows = np.stack([index_map.ghosts, least[owned:]], axis=1)
    rows = send_rows(mesh.comm, rows, index_map.owners)
    np.minimum.at(least, rows[:, 0] - index_map.local_range[0], rows[:, 1])
    return Ordering(mesh.comm, least[:owned])


def with_ghosts(index_map: IndexMap, owned: Longs) -> Longs:
    """Return integers of owned nodes, completed by those of the ghosts. Collective."""
    vector = la.vector(index_map, 1, dtype=np.int64)
    vector.array[: index_map.size_local] = owned
    vector.scatter_forward()
    return np.asarray(vector.array)


def _input_cells(mesh: Mesh) -> Longs:
    owned = mesh.topology.index_map(mesh.topology.dim).size_local
    return np.asarray(mesh.topology.original_cell_index[:owned], dtype=np.int64)
