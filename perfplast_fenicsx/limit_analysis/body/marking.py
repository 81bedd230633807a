"""Which cells have most of what is to become smaller."""

from mpi4py import MPI

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats


def largest_shares(comm: MPI.Intracomm, shares: Floats, part: float) -> npt.NDArray[np.bool_]:
    """The cells with the largest shares, which together have a part of the whole. Collective.

    The marking of W. Dörfler, doi:10.1137/0733054.

    Args:
        comm: The ranks.
        shares: Of the cells that this rank owns; those below zero count as zero.
        part: Of the sum over all cells, between 0 and 1.
    """
    shares = np.maximum(shares, 0.0)
    wanted = part * comm.allreduce(float(shares.sum()))
    low, high = 0.0, comm.allreduce(float(shares.max(initial=0.0)), MPI.MAX)
    halvings = 60  # steps from the largest share of a cell to the least that is marked
    for _ in range(halvings):
        middle = (low + high) / 2
        enough = comm.allreduce(float(shares[shares >= middle].sum())) >= wanted
        low, high = (middle, high) if enough else (low, middle)
    marked: npt.NDArray[np.bool_] = (shares >= low) & (shares > 0)
    return marked
