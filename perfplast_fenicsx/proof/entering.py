"""What a quadratic velocity enters on facets of contact: Bernstein's coefficients of its jumps."""

from itertools import combinations

import numpy as np

from perfplast_fenicsx.proof.body import Body, Floats
from perfplast_fenicsx.proof.touching import touching

SLOWEST = 1e-8
"""Velocities on facets count as so much of the largest at least: jumps of 1e-20 of that are the
rounding of a body at rest, however slow it is itself."""


def entering_of(body: Body, at_facets: Floats, fastest: float) -> tuple[float, float, str | None]:
    """What enters on facets of contact: relative to their velocities, as a volume, and a reason.

    Args:
        body: The bodies.
        at_facets: Velocities at the nodes of facets.
        fastest: The largest velocity of all.
    """
    d, reason = body.dim, None
    relative, volume = 0.0, 0.0
    speeds = np.maximum(np.abs(at_facets).max(axis=(1, 2), initial=0), SLOWEST * fastest)
    for one, other in body.contacts:
        pair = touching(body, one, other)
        if pair.apart:
            reason = f"{pair.apart} facets of contact or more match none of those opposite"
        edges = list(combinations(range(d), 2))
        ends = np.sort(pair.order[:, edges], axis=2)
        place = np.zeros((d, d), dtype=np.int64)
        for node, (a, b) in enumerate(edges, start=d):
            place[a, b] = node
        order = np.concatenate([pair.order, place[ends[..., 0], ends[..., 1]]], axis=1)
        opposite = np.take_along_axis(at_facets[pair.second], order[..., None], axis=1)
        enters = _bernstein(at_facets[pair.first] - opposite, body.normals[pair.first])
        faster = np.maximum(speeds[pair.first], speeds[pair.second])
        relative = max(relative, _largest_share(enters, faster))
        volume += float(enters @ body.areas[pair.first])
    for tag, normal in zip(body.obstacles, body.obstacle_normals, strict=True):
        facets = body.on(tag)
        enters = _bernstein(at_facets[facets], np.tile(normal, (len(facets), 1)))
        relative = max(relative, _largest_share(enters, speeds[facets]))
        volume += float(enters @ body.areas[facets])
    return relative, volume, reason


def _largest_share(parts: Floats, wholes: Floats) -> float:
    """The largest part of its whole; parts of nothing are nothing."""
    return float((parts / np.where(wholes > 0, wholes, 1.0)).max(initial=0))


def _bernstein(jump: Floats, normals: Floats) -> Floats:
    """Largest Bernstein coefficient of each quadratic jump along n; 0 if none is positive."""
    d = normals.shape[1]
    w = np.einsum("fni,fi->fn", jump, normals)
    for node, (a, b) in enumerate(combinations(range(d), 2), start=d):
        w[:, node] = 2 * w[:, node] - (w[:, a] + w[:, b]) / 2
    largest: Floats = np.maximum(w.max(axis=1, initial=0), 0)
    return largest
