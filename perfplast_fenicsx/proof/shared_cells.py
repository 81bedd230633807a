"""Find cells of two halves that share a volume: no plane separates them.

Two simplices are separate if their projections on some axis are separate. Possible axes are the
normals of the facets, and in 3D also the common normals of an edge of one simplex and an edge of
the other (separating axis theorem). If the projections overlap by less than a small share of each
projection, the simplices only touch.
"""

from collections.abc import Callable
from itertools import combinations

import numpy as np

from perfplast_fenicsx.proof.body import Body, Flags, Floats, Longs
from perfplast_fenicsx.proof.box_pairs import box_pairs

TOUCHING = 1e-6
"""Largest overlap of projections that only touch, as a share of the narrower projection."""


def shared_cells(
    one: Body, other: Body, differ: Callable[[Longs, Longs], Flags]
) -> tuple[Longs, Longs]:
    """Return pairs of cells that share a volume and differ.

    Args:
        one: The cells of a half.
        other: The cells of the other half.
        differ: Function that returns flags of pairs that differ. The checker decides only for these
            pairs whether they share a volume.
    """
    if np.array_equal(one.vertices, other.vertices) and np.array_equal(one.cells, other.cells):
        every: Longs = np.arange(len(one.cells))
        every = every[differ(every, every)]
        return every, every
    none: Longs = np.zeros(0, dtype=np.int64)
    places = [body.vertices[body.cells] for body in (one, other)]
    found: list[tuple[Longs, Longs]] = [(none, none)]
    for a, b in box_pairs(*(boxes_of(x) for x in places)):
        off = differ(a, b)
        a, b = a[off], b[off]
        common = have_common_volume(places[0][a], places[1][b])
        found.append((a[common], b[common]))
    first, second = (np.concatenate(numbers) for numbers in zip(*found, strict=True))
    return first, second


def boxes_of(places: Floats) -> Floats:
    """Return least and largest coordinates of simplices, shape (2, n, d) from (n, k, d)."""
    return np.stack([places.min(axis=1), places.max(axis=1)])


def have_common_volume(ones: Floats, others: Floats) -> Flags:
    """Return flags of pairs of simplices that share a volume.

    Args:
        ones: Vertices of the first simplex of each pair, shape (num_pairs, d + 1, d).
        others: Vertices of the second simplex of each pair, same shape.
    """
    d, found = ones.shape[2], np.ones(len(ones), dtype=bool)
    at_once = 20_000  # number of pairs processed together, limited by memory
    for some in np.array_split(np.arange(len(ones)), len(ones) // at_once + 1):
        middle = ones[some].mean(axis=1, keepdims=True)
        a, b = ones[some] - middle, others[some] - middle
        overlap = ~_apart(a, b, np.concatenate([_facing(a), _facing(b)], axis=1))
        if d == 3 and overlap.any():
            a, b = a[overlap], b[overlap]
            across = np.cross(_edges(a)[:, :, None], _edges(b)[:, None]).reshape(len(a), -1, 3)
            overlap[overlap] = ~_apart(a, b, np.asarray(across, dtype=np.float64))
        found[some] = overlap
    return found


def overlap_ends(ones: Floats, others: Floats) -> tuple[Floats, Flags]:
    """Return points whose convex hull is the overlap of two simplices.

    For each edge of one simplex, the points are the ends of its part within the other simplex.
    Every vertex of the overlap is one of these ends.

    Args:
        ones: Vertices of the first simplex of each pair, shape (num_pairs, d + 1, d).
        others: Vertices of the second simplex of each pair, same shape.

    Returns:
        The points, shape (num_pairs, n, d), and a flag for each point that exists.
    """
    rounding = 1e-9  # tolerance for barycentric coordinates
    found, there = [], []
    for x, y in ((ones, others), (others, ones)):
        ends = np.array(list(combinations(range(x.shape[1]), 2)))
        start, along = x[:, ends[:, 0]], x[:, ends[:, 1]] - x[:, ends[:, 0]]
        slopes = _facing(y)
        slopes[:, 0] *= -1  # now gradients of y's barycentric coordinates
        shares = np.einsum("pvi,pei->pev", slopes, start - y[:, :1])
        shares[..., 0] += 1.0
        rates = np.einsum("pvi,pei->pev", slopes, along)
        enters, leaves = rates > rounding, rates < -rounding
        cuts = np.divide(-shares, rates, out=np.zeros_like(rates), where=enters | leaves)
        first = np.where(enters, cuts, 0.0).max(axis=2)
        last = np.where(leaves, cuts, 1.0).min(axis=2)
        first, last = np.maximum(first, 0.0), np.minimum(last, 1.0)
        outside = (~enters & ~leaves & (shares < -rounding)).any(axis=2)
        inside = (first <= last + rounding) & ~outside
        found += [start + at[..., None] * along for at in (first, last)]
        there += [inside, inside]
    return np.concatenate(found, axis=1), np.concatenate(there, axis=1)


def _edges(simplices: Floats) -> Floats:
    pairs = np.array(list(combinations(range(simplices.shape[1]), 2)))
    return np.asarray(simplices[:, pairs[:, 1]] - simplices[:, pairs[:, 0]])


def _facing(simplices: Floats) -> Floats:
    """Return normals of the facets, not of unit length, shape (n, d + 1, d)."""
    sides = simplices[:, 1:] - simplices[:, :1]
    inner = np.linalg.inv(sides).transpose(0, 2, 1)
    return np.concatenate([inner.sum(axis=1, keepdims=True), inner], axis=1)


def _apart(ones: Floats, others: Floats, axes: Floats) -> Flags:
    """Return flags of pairs with separate projections on an axis that is not zero."""
    with np.errstate(all="ignore"):
        axes = axes / np.linalg.norm(axes, axis=2, keepdims=True)
    first, second = (np.einsum("pvi,pai->pav", x, axes) for x in (ones, others))
    widths = np.minimum(np.ptp(first, axis=2), np.ptp(second, axis=2))
    overlap = np.minimum(first.max(axis=2), second.max(axis=2))
    overlap = overlap - np.maximum(first.min(axis=2), second.min(axis=2))
    return np.asarray((overlap <= TOUCHING * widths).any(axis=1))
