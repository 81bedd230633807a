"""Provide lasting communicators, rows and sums of several ranks, and bounding boxes."""

import math

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import numpy.typing as npt
from dolfinx import la
from dolfinx.common import IndexMap

from perfplast_fenicsx.arrays import Floats, Longs

_LASTING: list[MPI.Intracomm] = [MPI.COMM_WORLD, MPI.COMM_SELF]


def lasting(comm: MPI.Intracomm | PETSc.Comm) -> MPI.Intracomm:
    """Return a communicator of the same ranks that is never freed. Collective.

    PETSc duplicates each communicator that it receives. On several ranks, an object that Python
    drops stays on this duplicate until :func:`drop_garbage`, and keeps the duplicate alive. A
    mesh's own communicator ends with the mesh, after which the garbage on it is unreachable. MPICH
    has at most 2048 communicators, so a program with many meshes would fail.

    Args:
        comm: Communicator of any ranks, for example of a mesh.
    """
    if isinstance(comm, PETSc.Comm):
        comm = comm.tompi4py()
    for known in _LASTING:
        if MPI.Comm.Compare(known, comm) in (MPI.IDENT, MPI.CONGRUENT):
            return known
    _LASTING.append(comm.Dup())
    return _LASTING[-1]


def drop_garbage(comm: MPI.Intracomm) -> None:
    """Destroy the PETSc objects that Python has dropped on all ranks. Collective.

    Args:
        comm: Communicator of any ranks; the objects are on its :func:`lasting` communicator.
    """
    if comm.size > 1:  # on one rank there is no garbage
        PETSc.garbage_cleanup(lasting(comm))


def send_rows(
    comm: MPI.Intracomm, rows: npt.NDArray, destination: npt.NDArray[np.integer]
) -> npt.NDArray:
    """Send each row to a rank, and return the rows that arrive at this rank. Collective.

    Args:
        comm: The ranks.
        rows: Rows, shape (num_rows, ...), of any type, including structured types. The type and the
            shape of a row must be the same on every rank.
        destination: Destination rank of each row, shape (num_rows,).

    Returns:
        The rows that arrived at this rank, in the order of their source ranks.
    """
    return Exchange(comm, destination).forward(rows)


class Exchange:
    """An exchange of rows between ranks, with one answer for each row."""

    def __init__(self, comm: MPI.Intracomm, destination: npt.NDArray[np.integer]) -> None:
        """Send each rank the number of rows that it will receive. Collective.

        Args:
            comm: The ranks.
            destination: Destination rank of each row, shape (num_rows,).
        """
        self._comm = comm
        self._order = np.argsort(destination, kind="stable")
        self._sent = np.bincount(destination.ravel(), minlength=comm.size)
        self._received = np.empty_like(self._sent)
        comm.Alltoall(self._sent, self._received)

    def forward(self, rows: npt.NDArray) -> npt.NDArray:
        """Send this rank's rows, and return the rows that arrive at this rank. Collective."""
        return exchange_rows(self._comm, rows[self._order], self._sent, self._received)

    def back(self, rows: npt.NDArray) -> npt.NDArray:
        """Send an answer for each arrived row; return the answers to the sent rows. Collective."""
        arrived = exchange_rows(self._comm, rows, self._received, self._sent)
        answers = np.empty_like(arrived)
        answers[self._order] = arrived
        return answers


def exchange_rows(
    comm: MPI.Intracomm, rows: npt.NDArray, sent: Longs, received: Longs
) -> npt.NDArray:
    """Send rows to ranks, and return the rows that arrive at this rank. Collective.

    The number of rows to and from each rank must be known.

    Args:
        comm: The ranks.
        rows: Rows, shape (num_rows, ...), of any type, sorted by destination rank.
        sent: Number of rows to each rank, shape (comm.size,).
        received: Number of rows from each rank, shape (comm.size,).

    Returns:
        The rows that arrived at this rank, in the order of their source ranks.
    """
    rows = np.ascontiguousarray(rows)
    arrived = np.empty((int(received.sum()), *rows.shape[1:]), dtype=rows.dtype)
    row = MPI.BYTE.Create_contiguous(rows.itemsize * math.prod(rows.shape[1:])).Commit()
    comm.Alltoallv([_bytes(rows), sent, row], [_bytes(arrived), received, row])
    row.Free()
    return arrived


def fetch_rows(
    comm: MPI.Intracomm, rows: npt.NDArray, numbers: npt.NDArray[np.integer]
) -> npt.NDArray:
    """Return rows with given indices of an array distributed over the ranks. Collective.

    Args:
        comm: The ranks.
        rows: This rank's rows, shape (num_rows, ...). Row indices continue from rank to rank.
        numbers: Indices of the rows to return on this rank, in any order, shape (n,).

    Returns:
        The rows, shape (n, ...).
    """
    ends = np.cumsum(comm.allgather(len(rows)))
    asked = Exchange(comm, np.searchsorted(ends, numbers, side="right"))
    wanted = asked.forward(np.asarray(numbers, dtype=np.int64))
    return asked.back(rows[wanted - ends[comm.rank] + len(rows)])


def _bytes(rows: npt.NDArray) -> npt.NDArray[np.uint8]:
    """Return a view of the rows as bytes, because MPI does not support structured types."""
    return rows.reshape(-1).view(np.uint8)


def bounding_box(comm: MPI.Intracomm, points: Floats) -> tuple[Floats, Floats]:
    """Return the smallest and largest coordinates of the points on all ranks. Collective."""
    low, high = points.min(axis=0, initial=np.inf), points.max(axis=0, initial=-np.inf)
    comm.Allreduce(MPI.IN_PLACE, low, MPI.MIN)
    comm.Allreduce(MPI.IN_PLACE, high, MPI.MAX)
    return low, high


def sums_at(
    index_map: IndexMap, width: int, *parts: tuple[npt.NDArray[np.integer], npt.ArrayLike]
) -> Floats:
    """Return sums of rows at mesh entities or nodes over all ranks. Collective.

    Args:
        index_map: The entities or nodes.
        width: Length of a row.
        parts: Pairs of local indices, shape (n,), and rows, shape (n, width) or one that broadcasts
            to it. An index may occur several times.

    Returns:
        Shape (num_local, width) with the ghosts of this rank.
    """
    vector = la.vector(index_map, width, dtype=np.float64)
    table = vector.array.reshape(-1, width)
    for entities, rows in parts:
        np.add.at(table, entities, rows)
    vector.scatter_reverse(la.InsertMode.add)
    vector.scatter_forward()
    return table.copy()
