"""Divide space into slabs, one for each rank, to bring nearby data together on one rank."""

from mpi4py import MPI

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.parallel import bounding_box, send_rows


class Slabs:
    """Divides space along its longest extent, with about equally many points in each slab."""

    def __init__(self, comm: MPI.Intracomm, places: Floats) -> None:
        """Choose the limits of the slabs. Collective.

        Args:
            comm: The ranks.
            places: Points of this rank, shape (n, gdim).
        """
        low, high = bounding_box(comm, places)
        self._comm, self.axis = comm, int(np.argmax(high - low))
        along = np.sort(places[:, self.axis])
        # Largest number of points from each rank that determine the limits of the slabs.
        samples = 200
        some = along[np.linspace(0, len(along) - 1, min(samples, len(along)), dtype=np.int64)]
        weights = np.full(len(some), len(along) / max(len(some), 1))
        every, weight = (np.concatenate(comm.allgather(part)) for part in (some, weights))
        order = np.argsort(every, kind="stable")
        before = np.cumsum(weight[order])
        shares = np.arange(1, comm.size) / comm.size * before[-1]
        self._ends = every[order][np.searchsorted(before, shares)]

    def send(self, rows: npt.NDArray, low: Floats, high: Floats) -> npt.NDArray:
        """Send rows to all ranks whose slabs they intersect. Collective.

        Args:
            rows: Rows of a structured type, shape (n,).
            low: Their lower ends along ``axis``, shape (n,).
            high: Their upper ends.
        """
        if self._comm.size == 1:
            return rows
        first = np.searchsorted(self._ends, low, side="left")
        count = np.searchsorted(self._ends, high, side="right") - first + 1
        which = np.repeat(np.arange(len(rows)), count)
        within = np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)
        return send_rows(self._comm, rows[which], first[which] + within)
