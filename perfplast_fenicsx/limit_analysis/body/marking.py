"""Which cells have most of what is to become smaller."""

from mpi4py import MPI

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.body.body_bounds import BodyBounds
from perfplast_fenicsx.problem.problem import Problem


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


def to_refine(problem: Problem, found: BodyBounds, part: float) -> npt.NDArray[np.bool_]:
    """Owned cells with a part of the gap or of the multipliers' dissipation. Collective.

    Args:
        problem: The bodies with their loads.
        found: Bounds on its mesh.
        part: Of either, between 0 and 1; all cells with 1.
    """
    dissipation = None if found.static is None else found.static.dissipation
    topology = problem.tagged_mesh.mesh.topology
    cells = topology.index_map(topology.dim)
    marked = np.full(cells.size_local, part >= 1.0)
    if dissipation is not None and part < 1.0:
        # Where next to no cells hold back the stress, the gap is theirs, and its shares are those
        # of a stress that is small elsewhere: nothing else is refined.
        most, few = 0.9, 0.005
        here = largest_shares(problem.comm, dissipation, most)
        if problem.comm.allreduce(int(here.sum())) < few * cells.size_global:
            return marked | here
    for shares in (found.shares, dissipation):
        if shares is not None:
            marked |= largest_shares(problem.comm, shares, part)
    return marked
