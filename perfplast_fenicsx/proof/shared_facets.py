"""Find coinciding outer facets of two halves, and the covered part of each facet.

Two sets of cells fill the same region if they have the same outer facets with the same outward
sides: the difference of their regions would have no boundary, but every bounded region has a
boundary. The facets of both sets may be divided differently.
"""

from dataclasses import dataclass

import numpy as np

from perfplast_fenicsx.proof.body import Body, Floats, Longs
from perfplast_fenicsx.proof.box_pairs import box_pairs

CLOSE = 1e-11
"""Distance from the plane of a facet that counts as zero, relative to the largest coordinate. It
covers the rounding of repeatedly divided cells."""

COVERED = 1e-6
"""Largest uncovered share of a facet that counts as zero, and the share of the smaller facet above
which the overlap of two facets counts."""


@dataclass(frozen=True)
class SharedFacets:
    """Pairs of facets that coincide and have their cells on the same side.

    Attributes:
        first: Indices of the facets of one half, shape (num_pairs,).
        second: Indices of the facets of the other half.
        alone: Centres of the facets of both halves that facets of the other half do not cover
            exactly once, shape (n, d).
    """

    first: Longs
    second: Longs
    alone: Floats


def shared_facets(one: Body, other: Body) -> SharedFacets:
    """Return the coinciding facets of two halves."""
    halves = (one, other)
    places = [body.vertices[body.facets] for body in halves]
    reach = [CLOSE * np.abs(x).max(axis=(1, 2)) for x in places]
    boxes = [
        np.stack([x.min(axis=1) - r[:, None], x.max(axis=1) + r[:, None]])
        for x, r in zip(places, reach, strict=True)
    ]
    none = np.zeros(0, dtype=np.int64)
    found: list[tuple[Longs, Longs, Floats]] = [(none, none, np.zeros(0))]
    for a, b in box_pairs(*boxes):
        facing = np.einsum("pi,pi->p", one.normals[a], other.normals[b]) > 0.5
        a, b = a[facing], b[facing]
        larger = (one.areas[a] >= other.areas[b])[:, None, None]
        large, small = (np.where(of, places[0][a], places[1][b]) for of in (larger, ~larger))
        normals = np.where(larger[:, 0], one.normals[a], other.normals[b])
        heights = np.einsum("pvi,pi->pv", small - large[:, :1], normals)
        least = np.minimum(one.widths[a], other.widths[b])
        slack = np.minimum(np.maximum(reach[0][a], reach[1][b]), 1e-3 * least)
        flat = (np.abs(heights) <= slack[:, None]).all(axis=1)
        a, b, large, small = a[flat], b[flat], large[flat], small[flat]
        common = _common(large, small, normals[flat], slack[flat])
        kept = common > COVERED * np.minimum(one.areas[a], other.areas[b])
        found.append((a[kept], b[kept], common[kept]))
    first, second, common = (np.concatenate(values) for values in zip(*found, strict=True))
    alone = []
    for body, x, at in zip(halves, places, (first, second), strict=True):
        covered = np.bincount(at, weights=common, minlength=len(x))
        lacks = ~(np.abs(covered - body.areas) <= COVERED * body.areas)
        alone.append(x[lacks].mean(axis=1))
    return SharedFacets(first, second, np.concatenate(alone))


def _common(large: Floats, small: Floats, normals: Floats, slack: Floats) -> Floats:
    """Return the common length or area of pairs of facets in one plane.

    Args:
        large: Vertices of the larger facet of each pair, shape (num_pairs, d, d).
        small: Vertices of the smaller facet, same shape.
        normals: Normal of each plane.
        slack: Distance that counts as zero.
    """
    if large.shape[2] == 2:
        along = np.stack([-normals[:, 1], normals[:, 0]], axis=1)
        ends = [np.einsum("pvi,pi->pv", x - large[:, :1], along) for x in (large, small)]
        least = np.maximum(*(end.min(axis=1) for end in ends))
        return np.maximum(np.minimum(*(end.max(axis=1) for end in ends)) - least, 0.0)
    frames = np.linalg.qr(
        np.concatenate([normals[:, :, None], np.tile(np.eye(3), (len(normals), 1, 1))], axis=2)
    )[0][:, :, 1:]
    flat = [_turned((x - large[:, :1]) @ frames) for x in (large, small)]
    # Green's theorem for the part of each boundary inside the other triangle; common parts count
    # once.
    once = _swept(flat[0], flat[1], slack, with_common=True)
    return once + _swept(flat[1], flat[0], slack, with_common=False)


def _turned(triangles: Floats) -> Floats:
    """Return plane triangles with their vertices in counterclockwise order."""
    sides = triangles[:, 1:] - triangles[:, :1]
    left = np.linalg.det(sides) > 0
    return np.where(left[:, None, None], triangles, triangles[:, [0, 2, 1]])


def _swept(triangles: Floats, inside: Floats, slack: Floats, with_common: bool) -> Floats:
    """Return the area swept about the origin by the parts of edges that lie in other triangles.

    Args:
        triangles: Vertices of the triangles with the edges, shape (num_pairs, 3, 2).
        inside: Vertices of the other triangles.
        slack: Distance that counts as zero.
        with_common: Whether the area includes parts that lie along edges of the other triangles.
    """
    ends = np.roll(triangles, -1, axis=1)
    sides = np.roll(inside, -1, axis=1) - inside
    along = np.einsum("pei,pli->pel", ends - triangles, sides) > 0
    depth = np.where(along & with_common, -slack[:, None, None], slack[:, None, None])
    inward = np.stack([-sides[..., 1], sides[..., 0]], axis=2)
    inward = inward / np.linalg.norm(inward, axis=2, keepdims=True)
    begin, end = (
        np.einsum("pei,pli->pel", x, inward)
        - np.einsum("pli,pli->pl", inside, inward)[:, None]
        - depth
        for x in (triangles, ends)
    )
    rise = end - begin
    with np.errstate(all="ignore"):
        crossing = -begin / rise
    enters = np.where(rise > 0, crossing, np.where((rise == 0) & (begin < 0), 2.0, 0.0))
    leaves = np.where(rise < 0, crossing, 1.0)
    least = np.clip(enters.max(axis=2), 0.0, 1.0)[..., None]
    most = np.clip(leaves.min(axis=2), 0.0, 1.0)[..., None]
    most = np.maximum(least, most)
    first, last = (triangles + t * (ends - triangles) for t in (least, most))
    areas = first[..., 0] * last[..., 1] - first[..., 1] * last[..., 0]
    return np.asarray(areas.sum(axis=1) / 2)
