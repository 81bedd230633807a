"""Pair opposite pieces of two surfaces, clip them, and compute points in their overlaps.

All pairs of pieces are clipped at once. A piece is a straight segment in plane meshes, or a
triangle in 3D. The guest is projected onto the host along the normal of the host, so all maps
between reference coordinates are affine. Triangles are clipped by Sutherland and Hodgman's
algorithm (Comm. ACM 17, 1974, doi 10.1145/360767.360802). Corners remain in the order in which the
algorithm finds them, and slivers keep their area.

The overlaps of curved facets are found between straight pieces. Their quadrature points are mapped
to the host facet by reference coordinates, and from there to the guest facet along the host's
normal. Therefore areas, positions and normals belong to the second-order facets, not to the pieces
(T. Dickopf and R. Krause, Int. J. Numer. Meth. Engng 77, 2009, doi 10.1002/nme.2464).
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain

from mpi4py import MPI

import basix
import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.contact.surfaces.surface_facets import Facets, Pieces, shape_functions
from perfplast_fenicsx.parallel import bounding_box, send_rows

NONE = 1e-15
"""An overlap counts as empty up to this fraction of the length or area of the host."""


@dataclass(frozen=True)
class Overlaps:
    """Simplices in which a host piece and a guest piece are opposite each other.

    Attributes:
        pair: Number of the pair of pieces for each simplex, shape (n,).
        host: Barycentric coordinates of the corners in the host, shape (n, corners, gdim).
        guest: Barycentric coordinates of the corners in the guest, same shape.
        share: Length or area of the simplex, relative to the host, shape (n,).
    """

    pair: Longs
    host: Floats
    guest: Floats
    share: Floats


def overlaps(host: Floats, guest: Floats) -> Overlaps:
    """Return the overlaps of pairs of pieces.

    Args:
        host: Corners of the hosts, shape (num_pairs, gdim, gdim).
        guest: Corners of the guests, same shape.
    """
    flat = _projected(host, guest)
    some = np.flatnonzero(_most(flat) > 0)  # excludes guests beyond an edge of the host
    found = (_segments if host.shape[1] == 2 else _triangles)(flat[some])
    return replace(found, pair=some[found.pair])


def _projected(host: Floats, guest: Floats) -> Floats:
    """Return the barycentric coordinates of the guests' corners with respect to the hosts.

    Returns:
        The coordinates of the corners, projected along the normals of the hosts, shape (num_pairs,
        corners, gdim). The coordinates of a corner sum to 1.
    """
    first = host[:, 0]
    edges = [host[:, i] - first for i in range(1, host.shape[2])]
    duals = _dual_edges(edges)
    flat = np.empty(guest.shape)
    for corner in range(guest.shape[1]):
        beyond = guest[:, corner] - first
        for i, dual in enumerate(duals, start=1):
            flat[:, corner, i] = _dot(dual, beyond)
    flat[:, :, 0] = 1 - flat[:, :, 1:].sum(axis=2)
    return flat


def _dual_edges(edges: Sequence[Floats]) -> list[Floats]:
    """Return in-plane vectors whose product is 1 with their own edge and 0 with the others."""
    if len(edges) == 1:
        return [edges[0] / _dot(edges[0], edges[0])[:, None]]
    a, b = edges
    aa, ab, bb = _dot(a, a), _dot(a, b), _dot(b, b)
    det = (aa * bb - ab * ab)[:, None]
    return [
        (bb[:, None] * a - ab[:, None] * b) / det,
        (aa[:, None] * b - ab[:, None] * a) / det,
    ]


def _most(flat: Floats) -> Floats:
    """Return, for each pair, the minimum over the coordinates of the largest value at a corner."""
    corners = range(flat.shape[1])
    largest = functools.reduce(np.maximum, (flat[:, corner] for corner in corners))
    return functools.reduce(np.minimum, largest.T)


def _segments(guest: Floats) -> Overlaps:
    ends = guest[:, :, 1]
    low = np.clip(ends.min(axis=1), 0, 1)
    high = np.clip(ends.max(axis=1), 0, 1)
    pair = np.flatnonzero(high - low > NONE)
    t = np.stack([low, high], axis=1)[pair]
    s = (t - ends[pair, :1]) / (ends[pair, 1:] - ends[pair, :1])
    return Overlaps(
        pair, np.stack([1 - t, t], axis=2), np.stack([1 - s, s], axis=2), t[:, 1] - t[:, 0]
    )


def _triangles(guest: Floats) -> Overlaps:
    """Return the overlaps of the reference triangle with guests given in host coordinates."""
    corners = guest[:, :, 1:]
    signed = _cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    turned = corners.copy()
    turned[signed < 0] = corners[signed < 0][:, [0, 2, 1]]
    polygon, count = _clipped(turned)
    pairs: list[Longs] = []
    cells: list[Floats] = []
    for k in range(1, polygon.shape[1] - 1):
        some = np.flatnonzero(count > k + 1)
        pairs.append(some)
        cells.append(polygon[some][:, [0, k, k + 1]])
    pair, cell = np.concatenate(pairs), np.concatenate(cells)
    share = _cross(cell[:, 1] - cell[:, 0], cell[:, 2] - cell[:, 0])
    kept = share > NONE
    pair, cell, share = pair[kept], cell[kept], share[kept]
    first = corners[pair, :1]
    edges = corners[pair, 1:] - first
    area = _cross(edges[:, 0], edges[:, 1])[:, None]
    b = _cross(cell - first, edges[:, None, 1]) / area
    c = _cross(edges[:, None, 0], cell - first) / area
    return Overlaps(
        pair,
        np.concatenate([1 - cell.sum(axis=2, keepdims=True), cell], axis=2),
        np.stack([1 - b - c, b, c], axis=2),
        share,
    )


def _clipped(guest: Floats) -> tuple[Floats, Longs]:
    """Return the reference triangle, clipped by counterclockwise triangles.

    Returns:
        Corners of the polygons, shape (n, most, 2), and the number of corners of each polygon, 0 to
        6.
    """
    num = len(guest)
    polygon = np.broadcast_to(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]), (num, 3, 2))
    count = np.full(num, 3)
    # Corners within this distance from an edge, relative to the host size, lie on the edge.
    on_edge = 1e-13
    for k in range(3):
        begin, end = guest[:, k, None], guest[:, (k + 1) % 3, None]
        along = (end - begin) / np.linalg.norm(end - begin, axis=2, keepdims=True)
        inside = _cross(along, polygon - begin)
        inside = np.where(np.abs(inside) < on_edge, 0.0, inside)
        number = np.arange(polygon.shape[1])
        real = number < count[:, None]
        after = np.where(number + 1 < count[:, None], number + 1, 0)
        next_inside = np.take_along_axis(inside, after, axis=1)
        kept, crossed = real & (inside >= 0), real & (inside * next_inside < 0)
        share = np.where(crossed, inside / np.where(crossed, inside - next_inside, 1.0), 0.0)
        onward = np.take_along_axis(polygon, after[..., None], axis=1) - polygon
        both = np.stack([polygon, polygon + share[..., None] * onward], axis=2)
        flags = np.stack([kept, crossed], axis=2).reshape(num, 2 * len(number))
        most = polygon.shape[1] + 1  # clipping at a line adds at most one corner
        order = np.argsort(~flags, axis=1, kind="stable")[:, :most]
        polygon = np.take_along_axis(
            both.reshape(num, 2 * len(number), 2), order[..., None], axis=1
        )
        count = np.minimum(flags.sum(axis=1), most)
    return polygon, count


def _dot(a: Floats, b: Floats) -> Floats:
    return np.asarray(np.einsum("ni,ni->n", a, b))


def _cross(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


@dataclass(frozen=True)
class OverlapPoints:
    """Quadrature points of n overlaps, with q points each.

    Attributes:
        host: Number of the host facet, shape (n,).
        guest: Number of the guest facet, shape (n,).
        own: Shape functions N of the host facet at the points, shape (n, q, nodes of a facet).
        other: Shape functions of the guest facet, same shape.
        x: Coordinates on the host facet, shape (n, q, gdim).
        normal: Normal of the host facet, interpolated between its nodes, same shape as ``x``.
        weight: Quadrature weights that include the length or area of the host facet, shape (n, q).
    """

    host: Longs
    guest: Longs
    own: Floats
    other: Floats
    x: Floats
    normal: Floats
    weight: Floats


def overlap_points(
    hosts: Facets,
    guests: Facets,
    pieces: tuple[Pieces, Pieces],
    numbers: tuple[Longs, Longs],
    found: Overlaps,
    degree: int,
) -> OverlapPoints:
    """Return the quadrature points in the overlaps of pieces.

    Args:
        hosts: Facets of the surface with the multipliers.
        guests: Facets of the other surface.
        pieces: Pieces of the hosts and of the guests.
        numbers: Number of the host piece and of the guest piece for each overlap.
        found: The overlaps.
        degree: Polynomial degree that the rule integrates exactly on straight facets.
    """
    (host, guest), (h, g) = pieces, numbers
    e, f = host.facet[h], guest.facet[g]
    points, weights = rule(host.x.shape[1], degree)
    at_host = points @ (found.host @ host.at[h])
    at_guest = points @ (found.guest @ guest.at[g])
    weight = weights * (found.share * host.measure[h])[:, None]
    bent = np.flatnonzero(host.curved[h])
    share = (found.share[bent] * host.part[h[bent]])[:, None]
    weight[bent] = weights * share * area_elements(hosts["x"][e[bent]], at_host[bent])
    (_, each), (_, count, gdim) = hosts["node"].shape, hosts["x"].shape
    own = shape_functions(gdim, each, at_host)
    x = (own if each == count else shape_functions(gdim, count, at_host)) @ hosts["x"][e]
    normal = own @ hosts["normal"][e]
    moved = np.flatnonzero(host.curved[h] | guest.curved[g])
    facet = guests["x"][f[moved]]
    at_guest[moved] = _carried(x[moved], normal[moved], facet, at_guest[moved])
    return OverlapPoints(e, f, own, shape_functions(gdim, each, at_guest), x, normal, weight)


def rule(gdim: int, degree: int) -> tuple[Floats, Floats]:
    """Return barycentric quadrature points and weights; the weights sum to 1."""
    kind = basix.CellType.interval if gdim == 2 else basix.CellType.triangle
    points, weights = (np.asarray(one) for one in basix.make_quadrature(kind, degree))
    first = 1 - points.sum(axis=1, keepdims=True)
    return np.concatenate([first, points], axis=1), weights / weights.sum()


def area_elements(x: Floats, at: Floats) -> Floats:
    """Return length or area elements, relative to the reference facet, shape (n, q)."""
    tangents = _tangents(x, at)
    if len(tangents) == 1:
        return np.asarray(np.linalg.norm(tangents[0], axis=2))
    return np.asarray(np.linalg.norm(np.cross(tangents[0], tangents[1]), axis=2))


def _tangents(x: Floats, at: Floats) -> list[Floats]:
    _, count, gdim = x.shape
    return [slope @ x for slope in shape_functions(gdim, count, at, 1)]


def _carried(x: Floats, normal: Floats, facet: Floats, at: Floats) -> Floats:
    """Return reference coordinates where lines meet facets, by one Newton step.

    Args:
        x: Points of the lines, shape (n, q, gdim).
        normal: Directions of the lines, same shape.
        facet: Facet of each line, shape (n, points of a facet, gdim).
        at: Reference coordinates near the intersections, from which the step starts, shape (n, q,
            gdim − 1).
    """
    _, count, gdim = facet.shape
    apart = x - shape_functions(gdim, count, at) @ facet
    tangents = _tangents(facet, at)
    if len(tangents) == 1:
        across = [np.stack([normal[..., 1], -normal[..., 0]], axis=-1)]
    else:
        pairs = ((tangents[1], normal), (normal, tangents[0]))
        across = [np.asarray(np.cross(a, b), dtype=np.float64) for a, b in pairs]
    whole = np.einsum("nqi,nqi->nq", tangents[0], across[0])
    step = np.stack([np.einsum("nqi,nqi->nq", apart, one) / whole for one in across], axis=2)
    # If the step would move a point by more than this in the reference facet of the guest, the
    # point stays in the piece: the gap is too wide, or the facet too oblique, for one step.
    astray = 0.25
    near = functools.reduce(np.maximum, np.abs(step).transpose(2, 0, 1)) <= astray
    return np.asarray(np.where(near[:, :, None], at + step, at))


def rendezvous(
    comm: MPI.Intracomm, hosts: Facets, guests: Facets, reach: float
) -> tuple[Facets, Facets]:
    """Send each host facet to one rank, and all guest facets within ``reach`` to the same rank.

    Collective.

    Host facets are assigned to ranks by slabs perpendicular to the longest axis. A guest facet goes
    to every rank whose bounding box of host facets, widened by ``reach``, intersects the guest's
    box.

    Args:
        comm: Communicator of the ranks.
        hosts: Facets on this rank of the surface with the multipliers.
        guests: Facets on this rank of the other surface.
        reach: Largest distance between opposite facets (length).

    Returns:
        The host facets and the guest facets that this rank receives.
    """
    centre = hosts["x"].mean(axis=1)
    low, high = bounding_box(comm, centre)
    axis = int(np.argmax(high - low))
    # Number of histogram bins by which space is divided into slabs with equal numbers of facets.
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
    """Return pairs of pieces for which a normal of the host piece may meet the guest piece.

    Args:
        host: Pieces of the surface with the multipliers.
        guest: Pieces of the other surface.
        reach: Largest distance of a guest in front of its host (length).
        behind: Largest depth of a guest inside the host's body (length).

    Returns:
        Numbers of the host and the guest in each pair, sorted by host.
    """
    none = np.zeros(0, dtype=np.int64)
    if not (len(host.facet) and len(guest.facet)):
        return none, none
    nearest, _ = cKDTree(guest.centre).query(host.centre)
    # Ratio of the largest distance along a normal to the distance from the nearest piece.
    oblique = 1.5
    apart = oblique * np.minimum(nearest, reach) + host.radius
    firsts: list[Longs] = [none]
    seconds: list[Longs] = [none]
    size = np.floor(np.log2(guest.radius))
    for each in np.unique(size):  # a few large pieces must not enlarge the search for small pieces
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
    """Return for each pair whether the pieces face each other and a normal may meet both."""
    n = host.normal[first]
    facing = np.einsum("ni,ni->n", n, guest.normal[second])
    between: Floats = guest.centre[second] - host.centre[first]
    along = np.einsum("ni,ni->n", between, n)
    aside = np.linalg.norm(between - along[:, None] * n, axis=1)
    sizes = host.radius[first] + guest.radius[second]
    # Pieces face each other if the cosine between their normals is below minus this value (45°).
    least_cosine = 0.7
    opposite: npt.NDArray[np.bool_] = (
        (facing < -least_cosine)
        & (aside <= sizes)
        & (along <= reach + sizes)
        & (along >= -behind - sizes)
    )
    return opposite
