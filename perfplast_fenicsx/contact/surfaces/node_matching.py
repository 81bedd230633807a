"""Match opposite nodes of two surfaces without gathering either.

Each node travels to the rank of its slab of space, where a k-d tree matches it; matched nodes may
travel on. A node is a row of a structured type. The matching reads its coordinates "x" and its
outward unit "normal".
"""

from dataclasses import dataclass

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.contact.surfaces.surface_nodes import SurfaceNodes
from perfplast_fenicsx.parallel import bounding_box, send_rows


@dataclass(frozen=True)
class Matching:
    """Matched nodes, each pair on one rank, and the nodes without a match.

    Attributes:
        primary: Primary nodes of this rank's pairs, shape (num_pairs,).
        secondary: Their secondary nodes, shape (num_pairs,).
        alone: Number of nodes of both surfaces without a partner, on all ranks.
        farthest: Largest distance of such a node to the nearest node of the other surface on the
            rank of the search; inf without such a node. 0 if all nodes match.
    """

    primary: SurfaceNodes
    secondary: SurfaceNodes
    alone: int
    farthest: float


def match_nodes(
    comm: MPI.Intracomm, primary: SurfaceNodes, secondary: SurfaceNodes, distance: float
) -> Matching:
    """Return the matched nodes of two surfaces that are opposite each other. Collective.

    Among the nearest nodes, the partner is the one most nearly opposite along the mean normal.
    Among several nodes at one point, it is the one with the most nearly opposite normal. Primary
    nodes within ``distance`` are matched first; the remaining ones are matched at growing
    distances, up to the size of the surfaces. The function verifies that each node has exactly one
    partner.

    Args:
        comm: The ranks.
        primary: This rank's nodes of the primary surface, shape (n,).
        secondary: This rank's nodes of the secondary surface.
        distance: Largest distance of touching nodes (length).
    """
    low, high = bounding_box(comm, np.concatenate([primary["x"], secondary["x"]]))
    size = float(np.linalg.norm(high - low))
    found: list[tuple[SurfaceNodes, SurfaceNodes]] = []
    twice = 0
    while True:
        near = _match_near(comm, primary, secondary, distance, low, high)
        found.append((near.primary, near.secondary))
        counts = (len(near.left_primary), len(near.left_secondary), near.twice)
        left = comm.allreduce(np.array(counts))
        twice += int(left[2])
        if not left[:2].all() or distance >= size:
            break
        primary, secondary = near.left_primary, near.left_secondary
        distance = max(4 * distance, size / 64)
    joined = [np.concatenate(nodes) for nodes in zip(*found, strict=True)]
    farthest = comm.allreduce(near.farthest, MPI.MAX)
    return Matching(joined[0], joined[1], int(left[:2].sum()) + twice, farthest)


@dataclass(frozen=True)
class _Near:
    """The matches that :func:`_match_near` finds on this rank.

    Attributes:
        primary: Matched nodes of the primary surface.
        secondary: Their partners.
        left_primary: Nodes of the primary surface without a match.
        left_secondary: Nodes of the secondary surface without a match.
        twice: Number of secondary nodes with more than one match.
        farthest: Largest distance of ``left_primary`` to the nearest node.
    """

    primary: SurfaceNodes
    secondary: SurfaceNodes
    left_primary: SurfaceNodes
    left_secondary: SurfaceNodes
    twice: int
    farthest: float


def _match_near(
    comm: MPI.Intracomm,
    primary: SurfaceNodes,
    secondary: SurfaceNodes,
    distance: float,
    low: Floats,
    high: Floats,
) -> _Near:
    """Return the matches of nodes within a distance. Collective."""
    axis = int(np.argmax(high - low))
    width = max(high[axis] - low[axis], distance) / comm.size

    def slab(x: Floats) -> Longs:
        return np.clip(np.floor((x - low[axis]) / width), 0, comm.size - 1).astype(np.int64)

    here = send_rows(comm, primary, slab(primary["x"][:, axis]))
    # The partner of a node may be this many times as far as the nearest node: surfaces that are
    # apart and not parallel have their nodes opposite along the mean normal, not at the shortest
    # distance.
    oblique = 1.2
    along, reach = secondary["x"][:, axis], oblique * distance
    lowest, highest = slab(along - reach), slab(along + reach)
    copies = highest - lowest + 1
    offset = np.arange(copies.sum()) - np.repeat(np.cumsum(copies) - copies, copies)
    there = send_rows(
        comm, np.repeat(_labelled(comm, secondary), copies), np.repeat(lowest, copies) + offset
    )

    far = np.full(len(here), np.inf)
    nearest = np.zeros(len(here), dtype=np.int64)
    if len(here) and len(there):
        most_candidates = 32  # number of nearest nodes that are examined
        many = np.arange(1, min(most_candidates, len(there)) + 1)
        fars, candidates = cKDTree(there["row"]["x"]).query(here["x"], k=many)
        far = fars[:, 0]
        # Distance, relative to the size of the surfaces, of nodes at the same point.
        same_place = 1e-9
        rounding = same_place * float(np.linalg.norm(high - low))
        misfit = _misfit(here[:, None], there["row"][candidates], rounding)
        misfit[fars > oblique * fars[:, :1] + rounding] = np.inf
        nearest = candidates[np.arange(len(here)), np.argmin(misfit, axis=1)]
    paired = far <= distance
    taken = there[nearest[paired]] if len(there) else there
    # several nodes, on this rank or on others, may have found the same secondary node
    times = np.bincount(send_rows(comm, taken["place"], taken["rank"]), minlength=len(secondary))
    return _Near(
        primary=here[paired],
        secondary=taken["row"],
        left_primary=here[~paired],
        left_secondary=secondary[times == 0],
        twice=int(np.maximum(times - 1, 0).sum()),
        farthest=float(far[~paired].max(initial=0.0)),
    )


def _labelled(comm: MPI.Intracomm, nodes: SurfaceNodes) -> npt.NDArray[np.void]:
    """Return the rows with their original rank and index."""
    labelled = np.empty(
        len(nodes), dtype=[("row", nodes.dtype), ("rank", np.int32), ("place", np.int64)]
    )
    labelled["row"], labelled["rank"], labelled["place"] = nodes, comm.rank, np.arange(len(nodes))
    return labelled


def _misfit(primary: SurfaceNodes, secondary: SurfaceNodes, rounding: float) -> Floats:
    """Return how far nodes are from being opposite each other; the arrays broadcast."""
    n, m = primary["normal"], secondary["normal"]
    facing = np.einsum("...i,...i->...", n, m)
    mean = n - m
    mean /= np.maximum(np.linalg.norm(mean, axis=-1, keepdims=True), 1e-300)
    between = (secondary["x"] - primary["x"])[..., : n.shape[-1]]
    apart = np.einsum("...i,...i->...", between, mean)
    sideways = np.linalg.norm(between - apart[..., None] * mean, axis=-1)
    far = np.linalg.norm(between, axis=-1)
    return np.asarray(sideways + (1 + facing) * (0.1 * far + rounding))
