"""Find coinciding outer facets of two halves, and the covered part of each facet.

Two sets of cells fill the same region if they have the same outer facets with the same outward
sides: the difference of their regions would have no boundary, but every bounded region has a
boundary. The facets of both sets may be divided differently.
"""

from dataclasses import dataclass

import numpy as np

from perfplast_fenicsx.proof.balls import U
from perfplast_fenicsx.proof.body import Body, Floats, Longs
from perfplast_fenicsx.proof.box_pairs import box_pairs
from perfplast_fenicsx.proof.shared_cells import boxes_of

ROUNDED = 64 * U
"""Distance from the plane of a facet that counts as zero, relative to the largest coordinate. It
covers the rounding of repeatedly divided cells."""

THIN = 1e-6
"""Largest such distance, relative to the height of the cell over the facet."""

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
    reach = ROUNDED * max(float(np.abs(x).max()) for x in places)
    slacks = [
        np.minimum(np.minimum(reach, THIN * _heights(body)), 1e-3 * body.widths) for body in halves
    ]
    boxes = [boxes_of(x) + reach * np.array([-1.0, 1.0])[:, None, None] for x in places]
    none = np.zeros(0, dtype=np.int64)
    found: list[tuple[Longs, Longs, Floats]] = [(none, none, np.zeros(0))]
    for a, b in box_pairs(*boxes):
        facing = np.einsum("pi,pi->p", one.normals[a], other.normals[b]) > 0.5
        a, b = a[facing], b[facing]
        larger = (one.areas[a] >= other.areas[b])[:, None, None]
        large, small = (np.where(of, places[0][a], places[1][b]) for of in (larger, ~larger))
        normals = np.where(larger[:, 0], one.normals[a], other.normals[b])
        heights = np.einsum("pvi,pi->pv", small - large[:, :1], normals)
        slack = np.minimum(slacks[0][a], slacks[1][b])
        flat = (np.abs(heights) <= slack[:, None]).all(axis=1)
        a, b, large, small = a[flat], b[flat], large[flat], small[flat]
        found.append((a, b, common_parts(large, small, normals[flat])))
    first, second, common = (np.concatenate(values) for values in zip(*found, strict=True))
    alone = []
    for body, x, slack, at in zip(halves, places, slacks, (first, second), strict=True):
        covered = np.bincount(at, weights=common, minlength=len(x))
        around = np.linalg.norm(x - np.roll(x, 1, axis=1), axis=2).sum(axis=1)
        edges = slack * (around if body.dim == 3 else 2.0)
        most = edges * (1 + np.bincount(at, weights=common > 0, minlength=len(x)))
        lacks = ~(np.abs(covered - body.areas) <= np.minimum(most, COVERED * body.areas))
        alone.append(x[lacks].mean(axis=1))
    kept = common > COVERED * np.minimum(one.areas[first], other.areas[second])
    return SharedFacets(first[kept], second[kept], np.concatenate(alone))


def _heights(body: Body) -> Floats:
    """Return the heights of the cells over ``facets``."""
    return np.asarray(body.dim * body.volumes[body.outer // (body.dim + 1)] / body.areas)


def common_parts(large: Floats, small: Floats, normals: Floats) -> Floats:
    """Return the common length or area of pairs of facets in one plane.

    Args:
        large: Vertices of the larger facet of each pair, shape (num_pairs, d, d).
        small: Vertices of the smaller facet, same shape.
        normals: Normal of each plane.
    """
    start = small[:, :1]  # near the common part, so that its rounding errors are small
    if large.shape[2] == 2:
        along = np.stack([-normals[:, 1], normals[:, 0]], axis=1)
        ends = [np.einsum("pvi,pi->pv", x - start, along) for x in (large, small)]
        least = np.maximum(*(end.min(axis=1) for end in ends))
        return np.maximum(np.minimum(*(end.max(axis=1) for end in ends)) - least, 0.0)
    frames = np.linalg.qr(
        np.concatenate([normals[:, :, None], np.tile(np.eye(3), (len(normals), 1, 1))], axis=2)
    )[0][:, :, 1:]
    around, inside = (_turned((x - start) @ frames) for x in (large, small))
    for k in range(3):
        inside = _cut(inside, around[:, k], around[:, (k + 1) % 3] - around[:, k])
    after = np.roll(inside, -1, axis=1)
    areas = inside[..., 0] * after[..., 1] - inside[..., 1] * after[..., 0]
    return np.asarray(areas.sum(axis=1) / 2)


def _cut(polygons: Floats, start: Floats, along: Floats) -> Floats:
    """Return the parts of polygons to the left of lines.

    Points to the right of a line move onto the line, where they add no area.

    Args:
        polygons: Points of plane polygons, shape (n, num_points, 2).
        start: A point of each line.
        along: Direction of each line.
    """
    left = np.stack([-along[:, 1], along[:, 0]], axis=1)
    left = (left / np.linalg.norm(left, axis=1, keepdims=True))[:, None]
    depth = ((polygons - start[:, None]) * left).sum(axis=2, keepdims=True)
    moved = polygons - np.minimum(depth, 0.0) * left
    after, deep = np.roll(polygons, -1, axis=1), np.roll(depth, -1, axis=1)
    crosses = depth * deep < 0
    share = np.divide(depth, depth - deep, out=np.zeros_like(depth), where=crosses)
    between = np.where(crosses, polygons + share * (after - polygons), moved)
    return np.stack([moved, between], axis=2).reshape(len(polygons), 2 * polygons.shape[1], 2)


def _turned(triangles: Floats) -> Floats:
    """Return plane triangles with their vertices in counterclockwise order."""
    sides = triangles[:, 1:] - triangles[:, :1]
    left = np.linalg.det(sides) > 0
    return np.where(left[:, None, None], triangles, triangles[:, [0, 2, 1]])
