"""Clip opposite pieces of two surfaces, all pairs at once.

A piece is a straight segment in the plane or a triangle in space. The guest is projected on the
host along the host's normal. All maps between reference coordinates are therefore affine. Triangles
are clipped by Sutherland and Hodgman's algorithm (Comm. ACM 17, 1974, doi 10.1145/360767.360802).
Corners remain in the order in which the algorithm finds them, and slivers keep their area.
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from perfplast_fenicsx.arrays import Floats, Longs

NONE = 1e-15
"""An overlap counts as empty up to this share of the host's length or area."""


@dataclass(frozen=True)
class Overlaps:
    """Simplices on which a host piece and a guest piece are opposite each other.

    Attributes:
        pair: Pair of pieces of each simplex, shape (n,).
        host: Barycentric coordinates of the corners in the host, shape (n, corners, gdim).
        guest: Barycentric coordinates of the corners in the guest, same shape.
        share: Length or area, relative to the host's, shape (n,).
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
    some = np.flatnonzero(_most(flat) > 0)  # excludes points beside an edge
    found = (_segments if host.shape[1] == 2 else _triangles)(flat[some])
    return replace(found, pair=some[found.pair])


def _projected(host: Floats, guest: Floats) -> Floats:
    """Return barycentric coordinates of the guests' corners in the hosts.

    Returns:
        The projection is along the hosts' normals. Shape (num_pairs, corners, gdim); the
        coordinates of a corner sum to 1.
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
    """Return in-plane vectors whose product with their own edge is 1 and with the others 0."""
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
    """Return the smallest coordinate bound that all corners satisfy, shape (num_pairs,)."""
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
    """Return the reference triangle clipped by the guests, in the host's coordinates."""
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
    """Return the reference triangle clipped by counterclockwise triangles.

    Returns:
        Corners of the polygons, shape (n, most, 2), and the number of corners of each, 0 to 6.
    """
    num = len(guest)
    polygon = np.broadcast_to(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]), (num, 3, 2))
    count = np.full(num, 3)
    # Corners within this distance of an edge, relative to the size of the host, lie on the edge.
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
        most = polygon.shape[1] + 1  # a line cuts off at least one corner
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
