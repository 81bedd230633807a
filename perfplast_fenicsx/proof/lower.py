"""Does a stress prove a lower bound? It is linear in each cell, and given at the cells' vertices.

λ is a lower bound of the limit load of the bodies where div σ + b = 0 in each cell for the force b
per volume of all loads at λ, tractions are equal on both sides of inner facets and those of the
loads on outer ones, contact pushes with the pressure q and has no shear, or where it rubs one of
‖τ‖ ≤ c + μq at most, and ‖Mσ‖ ≤ c − q·σ at each vertex with the cone of the cell (:mod:`cones`),
and so everywhere, as the stresses that keep to it are a convex set (static theorem, W. Prager,
P. G. Hodge, Theory of Perfectly Plastic Solids, 1951). With a pressure u in pores the cones bound
effective stresses σ′, and σ = σ′ − uI. What is left by rounding is a load of its own: it is
measured by what the weakest could bear of it, each row by itself and all together. Of bodies of
revolution all this is said of S = rσ, which is quadratic (:mod:`rings`), over 2π.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from perfplast_fenicsx.proof.body import Body, Flags, Floats, Longs
from perfplast_fenicsx.proof.cones import vectors
from perfplast_fenicsx.proof.load_kinds import Loads
from perfplast_fenicsx.proof.rigid import Rigid, rigid_of, sums_of
from perfplast_fenicsx.proof.rings import (
    PAIRS,
    coefficients_of_radius,
    facet_coefficients,
    on_axis,
    radii_of,
    times_radius,
    whole_stress,
)
from perfplast_fenicsx.proof.rubbing import excess, unheld
from perfplast_fenicsx.proof.touching import Touching, touching


@dataclass(frozen=True)
class Left:
    """What is left of the conditions of a stress.

    Attributes:
        measured: ``equilibrium``, ``inner_tractions``, ``outer_tractions``, ``tension`` and
            ``unequal_pressures``, as stresses relative to the least finite yield radius of the
            cells that each row touches (a cell and those that share its facets; both sides of a
            facet, of a contact too), and to the least of all where these are elastic;
            ``asymmetry``, relative to the least of all; ``left_of_load``, the sum of all forces
            without balance relative to those of the loads at λ, and ``left_of_strength``, relative
            to the least γV^((d − 1)/d) of a cell of volume V; ``yield_ratio``, the largest
            (‖Mσ‖ + q·σ)/c: the stress divided by it keeps to the cone, as 0 is inside. With
            rigid surfaces also ``rigid_forces``, force and moment over the area, with contact
            that rubs also ``unequal_shears``, ``shear``, beyond μq where nothing adheres,
            and ``shear_ratio``, the largest (‖τ‖ − μq)/c elsewhere, and of bodies of revolution
            ``axis``, the largest S there.
        forces: The sum of the magnitudes of all forces without balance.
        loads: That of the loads at λ.
        reason: Why the conditions of contact cannot be told, or None.
    """

    measured: dict[str, float]
    forces: float
    loads: float
    reason: str | None


def measure_stress(body: Body, stress: Floats, kinds: Sequence[Loads]) -> Left:
    """What is left of each condition, and what forbids to tell it.

    Args:
        body: The bodies.
        stress: σ, effective where there is a pressure in pores, at the vertices of each cell, shape
            (num_cells, d + 1, d, d), or coefficients of S, shape (num_cells, 6, 2, 2).
        kinds: All loads at λ, each kind by itself.
    """
    loads = sum(kinds[1:], start=kinds[0])
    rigid = rigid_of(body)
    d, radii, effective = body.dim, _strengths(body, stress), stress
    stress = stress if body.is_revolved else loads.total(effective)
    weakest = _least(radii)
    section = body.volumes ** ((d - 1) / d)  # radii of rings have r in them
    vector, divergence = _balance(body, stress, loads)
    left_in = np.linalg.norm(divergence, axis=2)
    in_cells = left_in.mean(axis=1) * body.volumes
    inner = body.sides[0]
    jumps = sum(
        _tractions(body, stress, side, _places(body, side), body.normals_of(side))
        for side in inner.T
    )
    on_facets = np.linalg.norm(jumps, axis=2)
    between = radii[inner // (d + 1)].min(axis=1)
    around = radii.copy()
    for side in (0, 1):
        np.minimum.at(around, inner[:, side] // (d + 1), between)
    outer, forces, reason = _outer(body, stress, loads, rigid, radii)
    size = np.ptp(body.vertices[body.cells], axis=1).max(axis=1)
    ratios = {
        "equilibrium": left_in.max(axis=1) * size / _finite(around, weakest),
        "inner_tractions": on_facets / _finite(between, weakest)[:, None],
        **outer,
    }
    measured = {"asymmetry": _largest(stress - stress.transpose(0, 1, 3, 2)) / weakest}
    measured |= {name: _largest(values) for name, values in ratios.items()}
    forces += float(in_cells.sum() + body.areas_of(inner[:, 0]) @ on_facets.mean(axis=1))
    loaded = sum(_size(body, kind) + sums_of(rigid, kind)[0] for kind in kinds)
    measured["left_of_load"] = _share(forces, loaded)
    measured["left_of_strength"] = _share(forces, float((radii * section).min()))
    plastic = body.plastic
    bounded = vector if body.is_revolved else vectors(effective)
    ratios_of_yield = body.cones.ratios(body.cone[plastic], bounded[plastic])
    if body.is_revolved:
        rho = coefficients_of_radius(radii_of(body))[plastic]
        ratios_of_yield = np.where(rho > 0, ratios_of_yield / np.where(rho > 0, rho, 1.0), 0.0)
        measured["axis"] = on_axis(body, stress) / weakest
    measured["yield_ratio"] = _largest(np.where(ratios_of_yield < 0, 0.0, ratios_of_yield))
    return Left(measured, forces, loaded, reason)


def _least(radii: Floats) -> float:
    """The least radius, the smallest number where there is none at all."""
    least = float(radii.min())
    return least if 0 < least < np.inf else float(np.finfo(np.float64).tiny)


def _finite(radii: Floats, weakest: float) -> Floats:
    """Those that are finite, and the weakest for the others."""
    return np.where(np.isfinite(radii), radii, weakest)


def _share(part: float, whole: float) -> float:
    """A part of a whole, ∞ if it is no number, or something of nothing."""
    if part == 0:
        return 0.0
    return part / whole if np.isfinite(part) and whole > 0 else np.inf


def _largest(values: Floats) -> float:
    """Largest magnitude; ∞ where one is no number."""
    largest = float(np.abs(values).max(initial=0))
    return largest if np.isfinite(largest) else np.inf


def _strengths(body: Body, stress: Floats) -> Floats:
    """What cells bear of a stress, or of S: their yield radius, or without cohesion the stress."""
    found, plastic = body.yield_radius.copy(), body.plastic
    if body.is_revolved:
        return found * radii_of(body).max(axis=1)
    found[plastic] = body.cones.own_radius(body.cone[plastic], vectors(stress[plastic]))
    return found


def _balance(body: Body, stress: Floats, loads: Loads) -> tuple[Floats, Floats]:
    """Vectors of the stress, and what is left of equilibrium, at one place of each cell or more."""
    if body.is_revolved:
        vector, rest = whole_stress(body, stress, loads.body_force)
        return vector, rest[..., None]
    divergence = np.einsum("cvij,cvj->ci", stress, body.gradients) + loads.body_force
    return vectors(stress), divergence[:, None]


def _size(body: Body, loads: Loads) -> float:
    """The sum of the magnitudes of all forces, of bodies of revolution over 2π."""
    if not body.is_revolved:
        return loads.size(body.volumes, body.areas)
    pushes = np.linalg.norm(_applied(body, loads), axis=2).mean(axis=1)
    weights = body.volumes * radii_of(body).mean(axis=1)
    return float(body.areas @ pushes + weights @ np.linalg.norm(loads.body_force, axis=1))


def _applied(body: Body, loads: Loads) -> Floats:
    """Tractions of loads at the vertices of facets, or coefficients of r times these."""
    if not body.is_revolved:
        return loads.traction
    return times_radius(body.vertices[body.facets][..., 0], loads.traction)


def _places(body: Body, sides: Longs) -> Longs:
    """Numbers in their cells of what is known of the stress on sides, alike from both cells."""
    d = body.dim
    if body.is_revolved:
        return facet_coefficients(body, sides)
    cells, places = sides // (d + 1), body.corners[sides % (d + 1)]
    numbers = np.take_along_axis(body.cells[cells], places, axis=1)
    return np.take_along_axis(places, np.argsort(numbers, axis=1), axis=1)


def _tractions(body: Body, stress: Floats, sides: Longs, places: Longs, normals: Floats) -> Floats:
    """Tractions there."""
    cells = sides // (body.dim + 1)
    tractions: Floats = np.einsum("fvij,fj->fvi", stress[cells[:, None], places], normals)
    return tractions


def _outer(
    body: Body, stress: Floats, loads: Loads, rigid: Sequence[Rigid], strengths: Floats
) -> tuple[dict[str, Floats], float, str | None]:
    """What is left on outer facets, relative to the weakest; the sum of forces, and a reason."""
    d = body.dim
    cells, places = body.outer // (d + 1), body.places
    rho = np.ones(places.shape)
    if body.is_revolved:
        places = np.column_stack([places, PAIRS[places[:, 0], places[:, 1]]])
        rho = coefficients_of_radius(body.vertices[body.facets][..., 0])
    traction = _tractions(body, stress, body.outer, places, body.normals)
    rest = traction - _applied(body, loads)
    free = ~body.held
    into = np.zeros_like(body.normals)  # where contact pushes from: σn = λt − p into
    times = np.zeros(len(into), dtype=int)
    adhesion, friction = np.zeros(len(into)), np.zeros(len(into))
    radii = strengths[cells]
    pairs: list[Touching] = [touching(body, one, other) for one, other in body.contacts]
    reason = None
    for pair, c, mu in zip(pairs, body.contact_adhesion, body.contact_friction, strict=True):
        weaker = np.minimum(radii[pair.first], radii[pair.second])
        for facets in (pair.first, pair.second):
            into[facets] = body.normals[facets]
            radii[facets] = weaker
            times[facets] += 1
            adhesion[facets], friction[facets] = c, mu
        held_at_first, at_second = body.held[pair.first], body.held[pair.second]
        if (c or mu) and (held_at_first.any(axis=1) & at_second.any(axis=1)).any():
            reason = "supports hold both sides of facets that rub"
    obstacles = zip(
        body.obstacles,
        body.obstacle_normals,
        body.obstacle_adhesion,
        body.obstacle_friction,
        strict=True,
    )
    for tag, normal, c, mu in obstacles:
        facets = body.on(tag)
        into[facets] = normal
        times[facets] += 1
        adhesion[facets], friction[facets] = c, mu
    if (times > 1).any():
        reason = "a facet touches two others"
    radii = _finite(radii, _least(strengths))[:, None]
    glued = np.isin(body.surface, body.rigid)
    if (times[glued] > 0).any() or body.held[glued].any():
        reason = "a rigid surface is in contact, or held by supports"
    off = [surface.resultant(body, rest) - surface.wanted(loads) for surface in rigid]
    rest = rest * ~glued[:, None, None]
    share = np.where(free, into, 0.0)
    square = np.einsum("fi,fi->f", share, share)
    # A contact whose normal leaves less than this free beside supports has no force to find.
    undetermined = 1e-12
    told = square > undetermined
    pressure = np.zeros(rest.shape[:2])
    pressure[told] = -np.einsum("fvi,fi->fv", rest[told], share[told]) / square[told, None]
    shears = (rest + pressure[..., None] * into[:, None]) * free[:, None]
    wrong = np.linalg.norm(shears, axis=2)
    tension = np.maximum(-pressure, 0.0)
    unequal = np.zeros_like(pressure)
    for pair in pairs:
        both = told[pair.first] & told[pair.second]
        opposite = np.take_along_axis(pressure[pair.second], _order(body, pair), axis=1)
        unequal[pair.first] = np.abs(pressure[pair.first] - opposite) * both[:, None]
    left = {"outer_tractions": wrong, "tension": tension, "unequal_pressures": unequal}
    ratios = {}
    rubs = (adhesion > 0) | (friction > 0)
    if rubs.any():
        apart = _unequal_shears(body, pairs, shears, rubs)
        rubs &= told  # what is not free to push has no shear that is known
        ringed = np.where(rho > 0, rho, 1.0)[rubs]
        told_of = (wrong[rubs] / ringed, pressure[rubs] / ringed, adhesion[rubs], friction[rubs])
        beyond = np.zeros_like(wrong)
        beyond[rubs] = ringed * unheld(*told_of)
        wrong[rubs] = 0.0
        left |= {"shear": beyond, "unequal_shears": apart}
        ratios["shear_ratio"] = excess(*told_of)
    forces = float(body.areas @ sum(left.values()).mean(axis=1))
    if rigid:
        forces += float(np.abs(off).sum())
        ratios["rigid_forces"] = np.array(
            [
                np.linalg.norm(of) / surface.area / radii[surface.facets].min()
                for of, surface in zip(off, rigid, strict=True)
            ]
        )
    return {name: values / radii for name, values in left.items()} | ratios, forces, reason


def _order(body: Body, pair: Touching) -> Longs:
    """Places of what is known on facets opposite, in the order of that on the first ones."""
    if not body.is_revolved:
        return pair.order
    return np.column_stack([pair.order, np.full(len(pair.order), 2)])


def _unequal_shears(body: Body, pairs: Sequence[Touching], shears: Floats, rubs: Flags) -> Floats:
    """What shear tractions of both sides of contact differ by where it rubs.

    Those of components that supports hold are not known of that side, and are what balances the
    other's.
    """
    found = np.zeros(shears.shape[:2])
    for pair in pairs:
        both = rubs[pair.first] & rubs[pair.second]
        free = ~body.held[pair.first] & ~body.held[pair.second]
        opposite = np.take_along_axis(shears[pair.second], _order(body, pair)[..., None], axis=1)
        off = np.linalg.norm((shears[pair.first] + opposite) * free[:, None], axis=2)
        found[pair.first] = off * both[:, None]
    return found
