"""Define an order of cells and nodes that does not depend on the distribution of the mesh.

Cells are numbered as in the input. Nodes are numbered by the first cell that contains them and by
their position in this cell. Files use this order, so runs on any number of ranks write the same
files and read each other's files. Each rank stores a block of consecutive numbers. All-to-all
communication moves values between these blocks and the owners of the cells and nodes.
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
    """An order of distributed cells or nodes by a key.

    Attributes:
        first: Number of the first entity in this rank's block.
        count: Number of entities in this rank's block.
        total: Number of entities on all ranks.
    """

    def __init__(self, comm: MPI.Intracomm, keys: Longs) -> None:
        """Sort the entities of all ranks. Collective.

        Args:
            comm: The ranks.
            keys: Keys of the entities that this rank owns, at least 0. No key occurs twice on all
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
        """Return the values of this rank's block from values of owned entities, shape (n, ...).

        Collective.
        """
        return self._to_keepers(values)[self._sorting]

    def from_blocks(self, values: npt.NDArray) -> npt.NDArray:
        """Return the values of owned entities from values of this rank's block, shape (count, ...).

        Collective.
        """
        kept = np.empty_like(values)
        kept[self._sorting] = values
        owned = np.empty((len(self._by_keeper), *values.shape[1:]), dtype=values.dtype)
        owned[self._by_keeper] = exchange_rows(self._comm, kept, self._kept, self._owned)
        return owned

    def numbers(self) -> Longs:
        """Return the number of each owned entity in this order. Collective."""
        return self.from_blocks(np.arange(self.first, self.first + self.count))

    def _to_keepers(self, values: npt.NDArray) -> npt.NDArray:
        """Send rows of owned entities to the ranks that store them. Collective."""
        return exchange_rows(self._comm, values[self._by_keeper], self._owned, self._kept)


@dataclass(frozen=True)
class Block:
    """This rank's rows of a distributed array.

    Attributes:
        values: The rows, shape (count, ...); the other dimensions are the same on every rank.
        first: Number of the first row.
        total: Number of rows on all ranks.
    """

    values: npt.NDArray
    first: int
    total: int

    @property
    def shape(self) -> tuple[int, ...]:
        """Return the shape of the whole array."""
        return (self.total, *self.values.shape[1:])


def block(ordering: Ordering, values: npt.NDArray) -> Block:
    """Return this rank's block of an array from the values of owned entities. Collective."""
    values = np.ascontiguousarray(ordering.to_blocks(values))
    return Block(values, ordering.first, ordering.total)


def cell_ordering(mesh: Mesh) -> Ordering:
    """Return the order of a mesh's cells in the input. Collective."""
    return Ordering(mesh.comm, _input_cells(mesh))


def node_ordering(mesh: Mesh, cells: Ints, index_map: IndexMap) -> Ordering:
    """Return the order of nodes by the first cell that contains them. Collective.

    Args:
        mesh: The mesh.
        cells: Local nodes of each local cell, shape (num_cells, nodes_per_cell).
        index_map: Index map of the nodes of the geometry or of the displacements.
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
    """Return integers of all local nodes, with ghosts, from those of owned nodes. Collective."""
    vector = la.vector(index_map, 1, dtype=np.int64)
    vector.array[: index_map.size_local] = owned
    vector.scatter_forward()
    return np.asarray(vector.array)


def _input_cells(mesh: Mesh) -> Longs:
    owned = mesh.topology.index_map(mesh.topology.dim).size_local
    return np.asarray(mesh.topology.original_cell_index[:owned], dtype=np.int64)
