"""Mark the cells with the largest contributions to a quantity."""

from mpi4py import MPI

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.body.body_bounds import BodyBounds
from perfplast_fenicsx.problem.problem import Problem


def largest_shares(comm: MPI.Intracomm, shares: Floats, part: float) -> npt.NDArray[np.bool_]:
    """Return the cells with the largest contributions that together have a given part of the sum.

    Collective.

    The marking of W. Dörfler, doi:10.1137/0733054.

    Args:
        comm: The ranks.
        shares: Contributions of the owned cells; negative ones count as zero.
        part: Part of the sum over all cells, between 0 and 1.
    """
    shares = np.maximum(shares, 0.0)
    wanted = part * comm.allreduce(float(shares.sum()))
    low, high = 0.0, comm.allreduce(float(shares.max(initial=0.0)), MPI.MAX)
    halvings = 60  # steps from the largest contribution to the least marked one
    for _ in range(halvings):
        middle = (low + high) / 2
        enough = comm.allreduce(float(shares[shares >= middle].sum())) >= wanted
        low, high = (middle, high) if enough else (low, middle)
    marked: npt.NDArray[np.bool_] = (shares >= low) & (shares > 0)
    return marked


def to_refine(problem: Problem, found: BodyBounds, part: float) -> npt.NDArray[np.bool_]:
    """Return owned cells with a part of the gap or of the multipliers' dissipation. Collective.

    In the plane the marked cells have the given part of the sum of both, each normalised by its
    total, with half weight for the dissipation.

    Args:
        problem: The bodies with their loads.
        found: Bounds on the mesh of the problem.
        part: Part of these sums, between 0 and 1; 1 marks all cells.
    """
    dissipation = None if found.static is None else found.static.dissipation
    topology = problem.tagged_mesh.mesh.topology
    cells = topology.index_map(topology.dim)
    marked = np.full(cells.size_local, part >= 1.0)
    if dissipation is not None and part < 1.0:
        # If very few cells limit the stress, they cause the whole gap, and the indicators elsewhere
        # belong to a small stress. Then only these cells are refined, unless the bounds are already
        # close and more stress there would not help.
        most, few, near = 0.9, 0.005, 0.1
        here = largest_shares(problem.comm, dissipation, most)
        if problem.comm.allreduce(int(here.sum())) < few * cells.size_global:
            marked |= here
            gap = found.lower.apart(found.upper)
            if gap is None or gap > near:
                return marked
            dissipation = np.where(here, 0.0, dissipation)
    every = [it for it in (found.shares, dissipation) if it is not None]
    if topology.dim == 2 and len(every) == 2:
        # A mechanism dissipates most next to singular points, which soon contribute little to the
        # gap.
        every = [_in_all(problem.comm, every[0]) + _in_all(problem.comm, every[1]) / 2]
    for shares in every:
        marked |= largest_shares(problem.comm, shares, part)
    return marked


def _in_all(comm: MPI.Intracomm, shares: Floats) -> Floats:
    """Return contributions relative to their sum, with negative ones as zero. Collective."""
    shares = np.maximum(shares, 0.0)
    whole = comm.allreduce(float(shares.sum()))
    return shares / whole if whole > 0 else shares
