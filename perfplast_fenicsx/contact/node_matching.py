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

from perfplast_fenicsx.parallel import Rows, bounding_box, send_rows


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


OBLIQUE = 1.2
"""The partner of a row may be so many times as far as the nearest row: surfaces that are apart and
not parallel have their nodes opposite along the mean normal, not at the shortest distance."""

CANDIDATES = 32
"""Rows nearest to one that are looked at."""

SAME_PLACE = 1e-9
"""Distance, relative to the size of the surfaces, of rows that are at the same place."""


def match_rows(
    comm: MPI.Intracomm, first: Rows, second: Rows, normals: slice, distance: float
) -> Matching:
    """Match the rows of two surfaces that lie opposite each other. Collective.

    Of the nearest rows the one is taken that lies most nearly opposite, along the mean normal; of
    several in one place that is the one with the most opposite normal. First rows within
    ``distance`` are matched; what is left is looked for in ever larger distances, up to the size of
    the surfaces. That each row has exactly one partner is counted, not assumed.

    Args:
        comm: The ranks.
        first: Shape (num_rows, width), this rank's rows of the first surface, x, y, z first.
        second: The same for the second surface.
        normals: Columns of the outward unit normals.
        distance: Largest distance of touching nodes (length).
    """
    low, high = bounding_box(comm, np.concatenate([first[:, :3], second[:, :3]]))
    size = float(np.linalg.norm(high - low))
    found: list[tuple[Rows, Rows]] = []
    twice = 0
    while True:
        near = _match_near(comm, first, second, normals, distance, low, high)
        found.append((near.first, near.second))
        left = comm.allreduce(np.array([len(near.left_first), len(near.left_second), near.twice]))
        twice += int(left[2])
        if not left[:2].all() or distance >= size:
            break
        first, second, distance = near.left_first, near.left_second, max(4 * distance, size / 64)
    joined = [np.concatenate(rows) for rows in zip(*found, strict=True)]
    farthest = comm.allreduce(near.farthest, MPI.MAX)
    return Matching(joined[0], joined[1], int(left[:2].sum()) + twice, farthest)


@dataclass(frozen=True)
class _Near:
    """What :func:`_match_near` finds on this rank.

    Attributes:
        first: Matched rows of the first surface.
        second: The rows of the second that they meet.
        left_first: Rows of the first that meet none.
        left_second: Rows of the second that meet none.
        twice: How often a row of the second meets more than one.
        farthest: Largest distance of ``left_first`` to the nearest row.
    """

    first: Rows
    second: Rows
    left_first: Rows
    left_second: Rows
    twice: int
    farthest: float


def _match_near(
    comm: MPI.Intracomm,
    first: Rows,
    second: Rows,
    normals: slice,
    distance: float,
    low: Rows,
    high: Rows,
) -> _Near:
    """Match rows within a distance. Collective."""
    axis = int(np.argmax(high - low))
    width = max(high[axis] - low[axis], distance) / comm.size

    def slab(x: Rows) -> npt.NDArray[np.int64]:
        return np.clip(np.floor((x - low[axis]) / width), 0, comm.size - 1).astype(np.int64)

    here = send_rows(comm, first, slab(first[:, axis]))
    second = np.column_stack([second, np.full(len(second), comm.rank), np.arange(len(second))])
    reach = OBLIQUE * distance
    lowest, highest = slab(second[:, axis] - reach), slab(second[:, axis] + reach)
    copies = highest - lowest + 1
    offset = np.arange(copies.sum()) - np.repeat(np.cumsum(copies) - copies, copies)
    there = send_rows(comm, np.repeat(second, copies, axis=0), np.repeat(lowest, copies) + offset)

    far = np.full(len(here), np.inf)
    nearest = np.zeros(len(here), dtype=np.int64)
    if len(here) and len(there):
        many = np.arange(1, min(CANDIDATES, len(there)) + 1)
        fars, candidates = cKDTree(there[:, :3]).query(here[:, :3], k=many)
        far = fars[:, 0]
        rounding = SAME_PLACE * float(np.linalg.norm(high - low))
        misfit = _misfit(here[:, None], there[candidates], normals, rounding)
        misfit[fars > OBLIQUE * fars[:, :1] + rounding] = np.inf
        nearest = candidates[np.arange(len(here)), np.argmin(misfit, axis=1)]
    paired = far <= distance
    taken = there[nearest[paired]] if len(there) else there[:0]
    # a row of the second surface may have been found by several, on this rank or on others
    back = send_rows(comm, taken[:, -2:], taken[:, -2].astype(np.int64))
    times = np.bincount(back[:, -1].astype(np.int64), minlength=len(second))
    return _Near(
        first=here[paired],
        second=taken[:, :-2],
        left_first=here[~paired],
        left_second=second[times == 0, :-2],
        twice=int(np.maximum(times - 1, 0).sum()),
        farthest=float(far[~paired].max(initial=0.0)),
    )


def _misfit(a: Rows, b: Rows, normals: slice, rounding: float) -> Rows:
    """How far rows are from lying opposite each other; arrays of rows that broadcast together."""
    n, m = a[..., normals], b[..., normals]
    facing = np.einsum("...i,...i->...", n, m)
    mean = n - m
    mean /= np.maximum(np.linalg.norm(mean, axis=-1, keepdims=True), 1e-300)
    between = (b[..., :3] - a[..., :3])[..., : n.shape[-1]]
    apart = np.einsum("...i,...i->...", between, mean)
    sideways = np.linalg.norm(between - apart[..., None] * mean, axis=-1)
    far = np.linalg.norm(between, axis=-1)
    return np.asarray(sideways + (1 + facing) * (0.1 * far + rounding))
