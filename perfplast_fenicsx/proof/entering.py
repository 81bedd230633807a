"""Interpenetration of a quadratic velocity on contact facets, by Bernstein's coefficients.

Where contact rubs it enters by what it parts too little for its slip, μ‖w_t‖ − w_n, as this is a
convex function of the jump; and ∫c‖w_t‖ is at most c times the area times the mean of the
coefficients' norms.
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from perfplast_fenicsx.proof.body import Body, Floats
from perfplast_fenicsx.proof.touching import obstacles_of, touching

SLOWEST = 1e-8
"""Velocities on facets count as so much of the largest at least: jumps of 1e-20 of that are the
rounding of a body at rest, however slow it is itself."""


@dataclass(frozen=True)
class Entering:
    """Interpenetration and slip of a velocity on contact facets.

    Attributes:
        relative: What enters, relative to their velocities.
        volume: The same times the area, all added up.
        slip: What slip dissipates, from above.
        reason: Why the conditions of contact cannot be checked, or None.
    """

    relative: float
    volume: float
    slip: float
    reason: str | None


def entering_of(body: Body, at_facets: Floats, fastest: float) -> Entering:
    """Return interpenetration and slip on contact facets, and motion across guides.

    Args:
        body: The bodies.
        at_facets: Velocities at the nodes of facets.
        fastest: The largest velocity of all.
    """
    d, reason = body.dim, None
    relative, volume, slip = 0.0, 0.0, 0.0
    speeds = np.maximum(np.abs(at_facets).max(axis=(1, 2), initial=0), SLOWEST * fastest)
    firsts, seconds = body.contacts.T
    rubs = zip(body.contact_adhesion, body.contact_friction, strict=True)
    for one, other, (adhesion, friction) in zip(firsts, seconds, rubs, strict=True):
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
        enters, slips = _bernstein(
            at_facets[pair.first] - opposite, body.normals[pair.first], float(friction)
        )
        faster = np.maximum(speeds[pair.first], speeds[pair.second])
        relative = max(relative, _largest_share(enters, faster))
        volume += float(enters @ body.areas[pair.first])
        slip += float(adhesion * (slips @ body.areas[pair.first]))
    for tag, normal, adhesion, friction in obstacles_of(body):
        facets = body.on(tag)
        normals = np.tile(normal, (len(facets), 1))
        enters, slips = _bernstein(at_facets[facets], normals, float(friction))
        relative = max(relative, _largest_share(enters, speeds[facets]))
        volume += float(enters @ body.areas[facets])
        slip += float(adhesion * (slips @ body.areas[facets]))
    facets = np.flatnonzero(body.guided.any(axis=1))
    for normals in (body.guided[facets], -body.guided[facets]):
        enters, _ = _bernstein(at_facets[facets], normals, 0.0)
        relative = max(relative, _largest_share(enters, speeds[facets]))
        volume += float(enters @ body.areas[facets])
    return Entering(relative, volume, slip, reason)


def _largest_share(parts: Floats, wholes: Floats) -> float:
    """Return the largest part of its whole; parts of nothing are nothing."""
    return float((parts / np.where(wholes > 0, wholes, 1.0)).max(initial=0))


def _bernstein(jump: Floats, normals: Floats, friction: float) -> tuple[Floats, Floats]:
    """Return sizes of the Bernstein coefficients of quadratic jumps, along n and across.

    Args:
        jump: At the nodes of facets, shape (n, num_nodes, d); along n positive where it enters.
        normals: Shape (n, d).
        friction: μ.

    Returns:
        The largest that enters or parts too little, 0 if none does; the mean norm across n.
    """
    d = normals.shape[1]
    w = jump.copy()
    for node, (a, b) in enumerate(combinations(range(d), 2), start=d):
        w[:, node] = 2 * jump[:, node] - (jump[:, a] + jump[:, b]) / 2
    along = np.einsum("fni,fi->fn", w, normals)
    across = np.linalg.norm(w - along[:, :, None] * normals[:, None], axis=2)
    largest: Floats = np.maximum((along + friction * across).max(axis=1, initial=0), 0)
    return largest, across.mean(axis=1)
