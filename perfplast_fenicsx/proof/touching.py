"""Which facets of two surfaces lie opposite each other, found anew from their coordinates."""

from dataclasses import dataclass
from itertools import product

import numpy as np

from perfplast_fenicsx.proof.body import Body, Floats, Longs

SAME_NORMAL = 1e-8
"""Normals whose components differ by less are the same."""

CLOSE = 1e-6
"""Distance across the normal that counts as none, relative to the smallest facet."""

FACING = 0.1
"""Facets face each other where their normals point so much against each other."""


@dataclass(frozen=True)
class Touching:
    """Facets of one surface and those of the other that are the same but for a shift along n.

    Attributes:
        first: Numbers of facets, shape (num_pairs,).
        second: Those opposite.
        order: Places of the latters' vertices, in the order of those opposite, (num_pairs, d).
        apart: Facets of the first surface that lie opposite others without matching them.
    """

    first: Longs
    second: Longs
    order: Longs
    apart: int


def touching(body: Body, one: np.int64, other: np.int64) -> Touching:
    """Match the facets of two surfaces.

    Args:
        body: The bodies.
        one: Tag of a surface.
        other: Tag of the other.
    """
    firsts, seconds = body.on(one), body.on(other)
    found: list[tuple[Longs, Longs, Longs]] = []
    apart = 0
    while len(firsts):
        normal = body.normals[firsts[0]]
        along = body.normals @ normal
        same = np.abs(body.normals[firsts] - normal).max(axis=1) <= SAME_NORMAL
        a, firsts = firsts[same], firsts[~same]
        b = seconds[np.abs(body.normals[seconds] + normal).max(axis=1) <= SAME_NORMAL]
        across = np.linalg.qr(np.column_stack([normal, np.eye(body.dim)]))[0][:, 1:]
        x = body.vertices[body.facets] @ across
        close = CLOSE * np.ptp(x[np.concatenate([a, b])], axis=1).max(axis=1).min()
        height = body.vertices[body.facets].mean(axis=1) @ normal
        partner = _nearest(x.mean(axis=1), height, a, b, close)
        a_found, b_found = a[partner >= 0], b[partner[partner >= 0]]
        gaps = np.linalg.norm(x[a_found][:, :, None] - x[b_found][:, None], axis=3)
        order = np.argmin(gaps, axis=2)
        whole = (gaps.min(axis=2) <= close).all(axis=1)
        whole &= (np.sort(order, axis=1) == np.arange(body.dim)).all(axis=1)
        found.append((a_found[whole], b_found[whole], order[whole]))
        left_a = np.setdiff1d(a, a_found[whole])
        left_b = np.setdiff1d(seconds[along[seconds] < -FACING], b_found[whole])
        apart += _overlapping(x, left_a, left_b, close)
    if not found:
        none = np.zeros(0, dtype=np.int64)
        return Touching(none, none, np.zeros((0, body.dim), dtype=np.int64), 0)
    first, second, order = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return Touching(first, second, order, apart)


def _nearest(x: Floats, height: Floats, a: Longs, b: Longs, close: float) -> Longs:
    """For each of a the place in b of the nearest facet straight above it; −1 if there is none."""
    partner, distance = np.full(len(a), -1), np.full(len(a), np.inf)
    box = np.floor(x / (4 * close)).astype(np.int64)
    weights = np.array([1, 1_000_003])[: x.shape[1]]
    order = np.argsort(box[b] @ weights)
    keys = (box[b] @ weights)[order]
    for shift in product((-1, 0, 1), repeat=x.shape[1]):
        wanted = (box[a] + np.array(shift)) @ weights
        start = np.searchsorted(keys, wanted, side="left")
        stop = np.searchsorted(keys, wanted, side="right")
        for step in range(int((stop - start).max(initial=0))):
            has = np.flatnonzero(start + step < stop)
            place = order[start[has] + step]
            gap = height[b[place]] - height[a[has]]
            above = (np.linalg.norm(x[a[has]] - x[b[place]], axis=1) <= close) & (gap >= -close)
            nearer = above & (gap < distance[has])
            partner[has[nearer]], distance[has[nearer]] = place[nearer], gap[nearer]
    return partner


def _overlapping(x: Floats, a: Longs, b: Longs, close: float) -> int:
    """How many of a have boxes that overlap one of b's."""
    if not (len(a) and len(b)):
        return 0
    low, high = x.min(axis=1), x.max(axis=1)
    count = 0
    for some in np.array_split(a, len(a) // 1000 + 1):
        meet = (low[some][:, None] < high[b] - close) & (low[b] < high[some][:, None] - close)
        count += int(meet.all(axis=2).any(axis=1).sum())
    return count
