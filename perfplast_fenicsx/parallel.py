"""Rows of numbers that travel between ranks, and the box around points of all ranks."""

from mpi4py import MPI

import numpy as np
import numpy.typing as npt

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


def bounding_box(comm: MPI.Intracomm, points: Rows) -> tuple[Rows, Rows]:
    """Smallest and largest coordinates of the points of all ranks."""
    low, high = points.min(axis=0, initial=np.inf), points.max(axis=0, initial=-np.inf)
    comm.Allreduce(MPI.IN_PLACE, low, MPI.MIN)
    comm.Allreduce(MPI.IN_PLACE, high, MPI.MAX)
    return low, high
