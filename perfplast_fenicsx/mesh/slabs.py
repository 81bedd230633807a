"""Slabs of space, one a rank: what lies in one place is brought together on one rank."""

from mpi4py import MPI

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.parallel import bounding_box, send_rows


class Slabs:
    """Divides space across its longest extent, with about as many places in each slab."""

    def __init__(self, comm: MPI.Intracomm, places: Floats) -> None:
        """Choose where slabs end. Collective.

        Args:
            comm: The ranks.
            places: Places of this rank, shape (n, gdim).
        """
        low, high = bounding_box(comm, places)
        self._comm, self.axis = comm, int(np.argmax(high - low))
        along = np.sort(places[:, self.axis])
        # Places that a rank contributes, at most, from which it is seen where the slabs are to end.
        samples = 200
        some = along[np.linspace(0, len(along) - 1, min(samples, len(along)), dtype=np.int64)]
        weights = np.full(len(some), len(along) / max(len(some), 1))
        every, weight = (np.concatenate(comm.allgather(part)) for part in (some, weights))
        order = np.argsort(every, kind="stable")
        before = np.cumsum(weight[order])
        shares = np.arange(1, comm.size) / comm.size * before[-1]
        self._ends = every[order][np.searchsorted(before, shares)]

    def send(self, rows: npt.NDArray, low: Floats, high: Floats) -> npt.NDArray:
        """Send rows to all ranks whose slabs they reach into. Collective.

        Args:
            rows: Shape (n,), of a structured type.
            low: Where they begin along ``axis``, shape (n,).
            high: Where they end.
        """
        if self._comm.size == 1:
            return rows
        first = np.searchsorted(self._ends, low, side="left")
        count = np.searchsorted(self._ends, high, side="right") - first + 1
        which = np.repeat(np.arange(len(rows)), count)
        within = np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)
        return send_rows(self._comm, rows[which], first[which] + within)
