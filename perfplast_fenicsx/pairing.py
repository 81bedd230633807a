"""Which node of one surface meets which node of another, found without gathering either.

Rows of both surfaces travel to the rank that keeps their slab of space, are matched there with a
k-d tree, and the matched rows may travel on. A row is any list of numbers whose first three are the
coordinates; integers below 2**53 survive unharmed.
"""

from dataclasses import dataclass

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

Rows = npt.NDArray[np.float64]


def send_rows(comm: MPI.Intracomm, rows: Rows, destination: npt.NDArray[np.integer]) -> Rows:
    """Send each row to a rank. Collective.

    Args:
        comm: The ranks.
        rows: Shape (num_rows, width); the width is the same on every rank.
        destination: Shape (num_rows,), the rank each row goes to.

    Returns:
        The rows that have arrived here, in the order of the ranks they come from.
    """
    parcels = comm.alltoall([rows[destination == rank] for rank in range(comm.size)])
    return np.concatenate(parcels)


@dataclass(frozen=True)
class Matching:
    """Matched rows, each pair on one rank, and what did not match.

    Attributes:
        first: Shape (num_pairs, width), rows of the first surface that are kept here.
        second: Same shape, the rows they meet.
        alone: Rows of both surfaces without a partner, on all ranks together.
        farthest: Largest distance of such a row to the nearest one of the other surface seen by
            the rank that looked; inf where it saw none. 0 if all match.
    """

    first: Rows
    second: Rows
    alone: int
    farthest: float


def match_rows(comm: MPI.Intracomm, first: Rows, second: Rows, distance: float) -> Matching:
    """Match the rows of two surfaces that lie within ``distance`` of each other. Collective.

    The nearest row is taken; that each has exactly one partner is counted, not assumed.

    Args:
        comm: The ranks.
        first: Shape (num_rows, width), this rank's rows of the first surface, x, y, z first.
        second: The same for the second surface.
        distance: Largest distance of a pair (length).
    """
    points = np.concatenate([first[:, :3], second[:, :3]])
    low = np.full(3, np.inf)
    high = np.full(3, -np.inf)
    if len(points):
        low, high = points.min(axis=0), points.max(axis=0)
    comm.Allreduce(MPI.IN_PLACE, low, MPI.MIN)
    comm.Allreduce(MPI.IN_PLACE, high, MPI.MAX)
    axis = int(np.argmax(high - low))
    width = max(high[axis] - low[axis], distance) / comm.size

    def slab(x: Rows) -> npt.NDArray[np.int64]:
        return np.clip(np.floor((x - low[axis]) / width), 0, comm.size - 1).astype(np.int64)

    here = send_rows(comm, first, slab(first[:, axis]))
    lowest, highest = slab(second[:, axis] - distance), slab(second[:, axis] + distance)
    copies = highest - lowest + 1
    offset = np.arange(copies.sum()) - np.repeat(np.cumsum(copies) - copies, copies)
    there = send_rows(comm, np.repeat(second, copies, axis=0), np.repeat(lowest, copies) + offset)

    far = np.full(len(here), np.inf)
    nearest = np.zeros(len(here), dtype=np.int64)
    if len(here) and len(there):
        far, nearest = cKDTree(there[:, :3]).query(here[:, :3])
    paired = far <= distance
    pairs = int(paired.sum())
    distinct = len(np.unique(nearest[paired]))
    counts = np.array([pairs, distinct, len(first), len(second)], dtype=np.int64)
    comm.Allreduce(MPI.IN_PLACE, counts, MPI.SUM)
    alone = (counts[2] - counts[0]) + (counts[3] - min(counts[0], counts[1]))
    farthest = comm.allreduce(float(far[~paired].max(initial=0.0)), MPI.MAX)
    return Matching(here[paired], there[nearest[paired]], int(alone), farthest)
