"""Does a stress prove a lower bound? It is linear in each cell, and given at the cells' vertices.

λ is a lower bound of the limit load of the bodies where div σ + λb = 0 in each cell, tractions are
equal on both sides of inner facets and those of λ on outer ones, contact pushes and has no shear,
and ‖dev σ‖ ≤ γ at each vertex, and so everywhere, ‖·‖ being convex (static theorem, W. Prager,
P. G. Hodge, Theory of Perfectly Plastic Solids, 1951).
"""

import numpy as np

from perfplast_fenicsx.proof.body import Body, Floats
from perfplast_fenicsx.proof.touching import touching

UNDETERMINED = 1e-12
"""A contact whose normal leaves less than this free beside supports has no force to find."""


def measure_stress(body: Body, stress: Floats, load: float) -> tuple[dict[str, float], str | None]:
    """What is left of each condition, relative to the largest yield radius; and what forbids it.

    Args:
        body: The bodies.
        stress: σ at the vertices of each cell, shape (num_cells, d + 1, d, d).
        load: λ.

    Returns:
        ``asymmetry``, ``equilibrium``, ``inner_tractions``, ``outer_tractions``, ``tension``,
        ``unequal_pressures`` and ``yield_ratio``, which is the largest ‖dev σ‖/γ. And a reason why
        the conditions of contact cannot be told, or None.
    """
    d, plastic = body.dim, body.plastic
    unit = body.yield_radius[plastic].max(initial=0) or 1.0
    size = np.ptp(body.vertices[body.cells], axis=1).max(axis=1, keepdims=True)
    divergence = np.einsum("cvij,cvj->ci", stress, body.gradients) + load * body.body_force
    traces = np.trace(stress, axis1=2, axis2=3)[..., None, None] / d
    sizes = np.linalg.norm(stress - traces * np.eye(d), axis=(2, 3))
    inner = body.sides[0]
    jumps = _inner_tractions(body, stress, inner[:, 0]) + _inner_tractions(
        body, stress, inner[:, 1]
    )
    outer, tension, unequal, reason = _outer(body, stress, load)
    left = {
        "asymmetry": _largest(stress - stress.transpose(0, 1, 3, 2)),
        "equilibrium": _largest(divergence * size),
        "inner_tractions": _largest(jumps),
        "outer_tractions": outer,
        "tension": tension,
        "unequal_pressures": unequal,
    }
    measured = {name: value / unit for name, value in left.items()}
    measured["yield_ratio"] = float(
        (sizes[plastic] / body.yield_radius[plastic, None]).max(initial=0)
    )
    return measured, reason


def _largest(values: Floats) -> float:
    """Largest magnitude; ∞ where one is no number."""
    largest = float(np.abs(values).max(initial=0))
    return largest if np.isfinite(largest) else np.inf


def _inner_tractions(body: Body, stress: Floats, sides: np.ndarray) -> Floats:
    """Tractions at the vertices of sides, those in the order of their numbers."""
    d = body.dim
    cells, places = sides // (d + 1), body.corners[sides % (d + 1)]
    numbers = np.take_along_axis(body.cells[cells], places, axis=1)
    places = np.take_along_axis(places, np.argsort(numbers, axis=1), axis=1)
    tractions: Floats
    tractions = np.einsum("fvij,fj->fvi", stress[cells[:, None], places], body.normals_of(sides))
    return tractions


def _outer(body: Body, stress: Floats, load: float) -> tuple[float, float, float, str | None]:
    """What is not balanced on outer facets, tension, differences of pressure, and a reason."""
    cells = body.outer // (body.dim + 1)
    traction = np.einsum("fvij,fj->fvi", stress[cells[:, None], body.places], body.normals)
    rest = traction - load * body.traction
    free = ~body.held
    into = np.zeros_like(body.normals)  # where contact pushes from: σn = λt − p into
    times = np.zeros(len(into), dtype=int)
    pairs = [touching(body, one, other) for one, other in body.contacts]
    for pair in pairs:
        for facets in (pair.first, pair.second):
            into[facets] = body.normals[facets]
            times[facets] += 1
    for tag, normal in zip(body.obstacles, body.obstacle_normals, strict=True):
        into[body.on(tag)] = normal
        times[body.on(tag)] += 1
    reason = "a facet touches two others" if (times > 1).any() else None
    share = np.where(free, into, 0.0)
    square = np.einsum("fi,fi->f", share, share)
    told = square > UNDETERMINED
    pressure = np.zeros(rest.shape[:2])
    pressure[told] = -np.einsum("fvi,fi->fv", rest[told], share[told]) / square[told, None]
    wrong = (rest + pressure[..., None] * into[:, None]) * free[:, None]
    unequal = [0.0]
    for pair in pairs:
        both = told[pair.first] & told[pair.second]
        opposite = np.take_along_axis(pressure[pair.second], pair.order, axis=1)
        unequal.append(_largest((pressure[pair.first] - opposite)[both]))
    return _largest(wrong), max(0.0, -float(pressure.min(initial=0))), max(unequal), reason
