"""Pair pieces of two surfaces that may be opposite each other, without gathering a surface."""

from itertools import chain

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.contact.surfaces.surface_facets import Facets, Pieces
from perfplast_fenicsx.parallel import bounding_box, send_rows


def rendezvous(
    comm: MPI.Intracomm, hosts: Facets, guests: Facets, reach: float
) -> tuple[Facets, Facets]:
    """Send each host facet to one rank, and all guest facets within reach of it to the same rank.

    Collective.

    Hosts are distributed by slabs of space along the longest axis. Guests go to every rank with a
    host whose box, widened by the reach, they intersect.

    Args:
        comm: The ranks.
        hosts: This rank's facets of the surface that carries the multipliers.
        guests: This rank's facets of the other surface.
        reach: Largest distance (length).
    """
    centre = hosts["x"].mean(axis=1)
    low, high = bounding_box(comm, centre)
    axis = int(np.argmax(high - low))
    # Bins of the histogram that divides space into slabs with equal numbers of facets.
    most_bins = 4096
    width = max(float(high[axis] - low[axis]), np.finfo(float).tiny) / most_bins
    bins = np.clip(((centre[:, axis] - low[axis]) / width).astype(np.int64), 0, most_bins - 1)
    counts = comm.allreduce(np.bincount(bins, minlength=most_bins))
    before = np.cumsum(counts) - counts
    slab = np.minimum(before * comm.size // max(int(counts.sum()), 1), comm.size - 1)
    here = send_rows(comm, hosts, slab[bins])

    points = here["x"].reshape(-1, here["x"].shape[2])
    box = np.stack([points.min(axis=0, initial=np.inf), points.max(axis=0, initial=-np.inf)])
    boxes = np.array(comm.allgather(box))
    lowest, highest = guests["x"].min(axis=1), guests["x"].max(axis=1)
    meets = (lowest[:, None] <= boxes[:, 1] + reach) & (highest[:, None] >= boxes[:, 0] - reach)
    guest, rank = np.nonzero(meets.all(axis=2))
    return here, send_rows(comm, guests[guest], rank)


def candidates(host: Pieces, guest: Pieces, reach: float, behind: float) -> tuple[Longs, Longs]:
    """Return pairs of pieces in which the host's normal may meet the guest.

    Args:
        host: Pieces of one surface.
        guest: Pieces of the other.
        reach: Largest distance in front of the host (length).
        behind: Largest distance of a guest inside the host (length).

    Returns:
        Numbers of the host and of the guest in each pair, sorted by host.
    """
    none = np.zeros(0, dtype=np.int64)
    if not (len(host.facet) and len(guest.facet)):
        return none, none
    nearest, _ = cKDTree(guest.centre).query(host.centre)
    # Ratio of the largest distance along a normal to the distance of the nearest piece.
    oblique = 1.5
    apart = oblique * np.minimum(nearest, reach) + host.radius
    firsts: list[Longs] = [none]
    seconds: list[Longs] = [none]
    size = np.floor(np.log2(guest.radius))
    for each in np.unique(size):  # a few large pieces must not enlarge the search for the others
        some = np.flatnonzero(size == each)
        within = apart + guest.radius[some].max()
        found = cKDTree(guest.centre[some]).query_ball_point(host.centre, within)
        counts: Longs = np.fromiter(map(len, found), np.int64, len(found))
        every: Longs = np.fromiter(chain.from_iterable(found), np.int64, counts.sum())
        firsts.append(np.repeat(np.arange(len(host.facet)), counts))
        seconds.append(some[every])
    first, second = np.concatenate(firsts), np.concatenate(seconds)
    kept = _opposite(host, guest, first, second, reach, behind)
    first, second = first[kept], second[kept]
    order = np.argsort(first, kind="stable")
    return first[order], second[order]


def _opposite(
    host: Pieces, guest: Pieces, first: Longs, second: Longs, reach: float, behind: float
) -> npt.NDArray[np.bool_]:
    """Return whether pieces face each other and a normal of one may meet the other."""
    n = host.normal[first]
    facing = np.einsum("ni,ni->n", n, guest.normal[second])
    between: Floats = guest.centre[second] - host.centre[first]
    along = np.einsum("ni,ni->n", between, n)
    aside = np.linalg.norm(between - along[:, None] * n, axis=1)
    sizes = host.radius[first] + guest.radius[second]
    # Pieces face each other if the cosine of their normals is below the negative of this (45°).
    least_cosine = 0.7
    opposite: npt.NDArray[np.bool_] = (
        (facing < -least_cosine)
        & (aside <= sizes)
        & (along <= reach + sizes)
        & (along >= -behind - sizes)
    )
    return opposite
