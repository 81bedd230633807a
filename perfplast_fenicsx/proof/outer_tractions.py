"""Compute the residuals of a stress on outer facets, from loads, contact and rigid surfaces."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from perfplast_fenicsx.proof.body import Body, Flags, Floats, Longs
from perfplast_fenicsx.proof.least_radii import finite, least_of
from perfplast_fenicsx.proof.load_kinds import Loads
from perfplast_fenicsx.proof.rigid import Rigid
from perfplast_fenicsx.proof.rings import PAIRS, applied, coefficients_of_radius
from perfplast_fenicsx.proof.rubbing import excess, unheld
from perfplast_fenicsx.proof.touching import Touching, obstacles_of, touching


@dataclass(frozen=True)
class Outer:
    """Residuals on outer facets.

    Attributes:
        ratios: Residual of each condition, relative to the weakest cell of its row, or to its
            limit.
        lost: Unbalanced forces of each facet, shape (num_facets,).
        of_plates: Unbalanced forces on each rigid surface, shape (num_rigid,).
        reacts: Magnitudes of the forces that contact and rigid surfaces exert on each facet.
        reason: Reason why the contact conditions cannot be checked, or None.
    """

    ratios: dict[str, Floats]
    lost: Floats
    of_plates: Floats
    reacts: Floats
    reason: str | None


def tractions_on(
    body: Body, stress: Floats, sides: Longs, places: Longs, normals: Floats
) -> Floats:
    """Return the tractions of a stress on sides, at the given places in their cells."""
    cells = sides // (body.dim + 1)
    tractions: Floats = np.einsum("fvij,fj->fvi", stress[cells[:, None], places], normals)
    return tractions


@dataclass(frozen=True)
class _Met:
    """The bodies, obstacles and guides that outer facets touch.

    Attributes:
        into: Direction of contact pressure of each facet, σn = λt − p into; 0 without contact.
        touches: Whether each facet touches a body, an obstacle or a guide.
        adhesion: Adhesion of each facet.
        friction: Coefficient of friction of each facet.
        radii: Strength of the weaker of the cells on both sides of each facet.
        pairs: Facets of each contact with their opposite facets.
        reason: Reason why the contact conditions cannot be checked, or None.
    """

    into: Floats
    touches: Flags
    adhesion: Floats
    friction: Floats
    radii: Floats
    pairs: list[Touching]
    reason: str | None


def _met(body: Body, radii: Floats) -> _Met:
    """Return the contact conditions of outer facets.

    Args:
        body: The bodies.
        radii: Strength of each facet's cell, which the function overwrites.
    """
    into = np.zeros_like(body.normals)  # direction of contact pressure: σn = λt − p into
    times = np.zeros(len(into), dtype=int)
    adhesion, friction = np.zeros(len(into)), np.zeros(len(into))
    pairs: list[Touching] = [touching(body, one, other) for one, other in body.contacts]
    reason = None
    for pair, c, mu in zip(pairs, body.contact_adhesion, body.contact_friction, strict=True):
        if pair.apart:
            reason = f"at least {pair.apart} facets of contact have no matching opposite facet"
        weaker = np.minimum(radii[pair.first], radii[pair.second])
        for facets in (pair.first, pair.second):
            into[facets] = body.normals[facets]
            radii[facets] = weaker
            np.add.at(times, facets, 1)
            adhesion[facets], friction[facets] = c, mu
        held_at_first, at_second = body.held[pair.first], body.held[pair.second]
        if (c or mu) and (held_at_first.any(axis=1) & at_second.any(axis=1)).any():
            reason = "supports hold both sides of facets with friction"
    for tag, normal, c, mu in obstacles_of(body):
        facets = body.on(tag)
        into[facets] = normal
        times[facets] += 1
        adhesion[facets], friction[facets] = c, mu
    guided = body.guided.any(axis=1)
    into[guided] = body.guided[guided]
    times[guided] += 1
    if (times > 1).any():
        reason = "a facet touches two others"
    return _Met(into, times > 0, adhesion, friction, radii, pairs, reason)


def outer_tractions(
    body: Body, stress: Floats, loads: Loads, rigid: Sequence[Rigid], strengths: Floats
) -> Outer:
    """Return the residuals on outer facets, and the reason if contact cannot be checked.

    Args:
        body: The bodies.
        stress: Total stress whose equilibrium with the loads is measured.
        loads: All loads together.
        rigid: Rigid surfaces.
        strengths: Strengths of the cells (:func:`least_radii`).
    """
    d = body.dim
    cells, places = body.outer // (d + 1), body.places
    rho = np.ones(places.shape)
    if body.is_revolved:
        places = np.column_stack([places, PAIRS[places[:, 0], places[:, 1]]])
        rho = coefficients_of_radius(body.vertices[body.facets][..., 0])
    traction = tractions_on(body, stress, body.outer, places, body.normals)
    rest = traction - applied(body, loads)
    free = ~body.held
    met = _met(body, strengths[cells])
    into, guided, reason = met.into, body.guided.any(axis=1), met.reason
    radii = finite(met.radii, least_of(strengths))[:, None]
    glued = np.isin(body.surface, body.rigid)
    if met.touches[glued].any() or body.held[glued].any():
        reason = "a rigid surface is in contact, or held by supports"
    off = [surface.resultant(body, rest) - surface.wanted(loads) for surface in rigid]
    rest = rest * ~glued[:, None, None]
    share = np.where(free, into, 0.0)
    square = np.einsum("fi,fi->f", share, share)
    # If supports leave less than this part of a contact's normal free, the contact force is
    # unknown.
    undetermined = 1e-12
    told = square > undetermined
    pressure = np.zeros(rest.shape[:2])
    pressure[told] = -np.einsum("fvi,fi->fv", rest[told], share[told]) / square[told, None]
    shears = (rest + pressure[..., None] * into[:, None]) * free[:, None]
    wrong = np.linalg.norm(shears, axis=2)
    pressure[guided] = 0.0  # forces of supports may also pull
    tension = np.maximum(-pressure, 0.0)
    unequal = np.zeros_like(pressure)
    for pair in met.pairs:
        both = told[pair.first] & told[pair.second]
        opposite = np.take_along_axis(pressure[pair.second], _order(body, pair), axis=1)
        unequal[pair.first] = np.abs(pressure[pair.first] - opposite) * both[:, None]
    left = {"outer_tractions": wrong, "tension": tension, "unequal_pressures": unequal}
    ratios = {}
    adhesion, friction = met.adhesion, met.friction
    rubs = (adhesion > 0) | (friction > 0)
    if rubs.any():
        apart = _unequal_shears(body, met.pairs, shears, rubs)
        rubs &= told  # where the normal is not free, the shear is unknown
        ringed = np.where(rho > 0, rho, 1.0)[rubs]
        told_of = (wrong[rubs] / ringed, pressure[rubs] / ringed, adhesion[rubs], friction[rubs])
        beyond = np.zeros_like(wrong)
        beyond[rubs] = ringed * unheld(*told_of)
        wrong[rubs] = 0.0
        left |= {"shear": beyond, "unequal_shears": apart}
        ratios["shear_ratio"] = excess(*told_of)
    lost = body.areas * sum(left.values()).mean(axis=1)
    reacts = np.abs(pressure) + np.where(rubs[:, None], np.linalg.norm(shears, axis=2), 0.0)
    reacts += np.where(glued[:, None], np.linalg.norm(traction, axis=2), 0.0)
    if rigid:
        ratios["rigid_forces"] = np.array(
            [
                np.linalg.norm(of) / surface.area / radii[surface.facets].min()
                for of, surface in zip(off, rigid, strict=True)
            ]
        )
    ratios |= {name: values / radii for name, values in left.items()}
    of_plates = np.array([float(np.abs(of).sum()) for of in off])
    return Outer(ratios, lost, of_plates, body.areas * reacts.mean(axis=1), reason)


def _order(body: Body, pair: Touching) -> Longs:
    """Return the indices of values on opposite facets, in the order of the first facets' values."""
    if not body.is_revolved:
        return pair.order
    return np.column_stack([pair.order, np.full(len(pair.order), 2)])


def _unequal_shears(body: Body, pairs: Sequence[Touching], shears: Floats, rubs: Flags) -> Floats:
    """Return differences of shear tractions on both sides of contact with friction.

    Components that supports hold are unknown on their side of the contact. They balance the
    components on the other side.
    """
    found = np.zeros(shears.shape[:2])
    for pair in pairs:
        both = rubs[pair.first] & rubs[pair.second]
        free = ~body.held[pair.first] & ~body.held[pair.second]
        opposite = np.take_along_axis(shears[pair.second], _order(body, pair)[..., None], axis=1)
        off = np.linalg.norm((shears[pair.first] + opposite) * free[:, None], axis=2)
        found[pair.first] = off * both[:, None]
    return found
