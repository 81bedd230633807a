"""Integrate over the overlap of two surfaces with dual functions: the rows of mortar contact.

The module sums the integrals of all overlapping pieces by pairs of facets, and makes them dual for
each facet. Where the host has Bernstein functions and its normal n varies, there are also integrals
with n, interpolated between the nodes. Coefficients of a displacement vector times a nodal normal
differ by O(h²) from the coefficients of the normal component.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.sparse import csr_array

from perfplast_fenicsx.arrays import Floats, Longs, PairFlags
from perfplast_fenicsx.contact.mortar.clipping import Overlaps, overlaps
from perfplast_fenicsx.contact.mortar.dual_functions import (
    coupled,
    dual_factors,
    own_basis,
    turning,
)
from perfplast_fenicsx.contact.mortar.facet_pairing import candidates
from perfplast_fenicsx.contact.mortar.overlap_points import area_elements, overlap_points, rule
from perfplast_fenicsx.contact.surfaces.surface_facets import (
    Facets,
    Pieces,
    pieces_of,
    shape_functions,
)


@dataclass(frozen=True)
class Integrals:
    """Integrals over the facets on this rank, for the nodes of the host.

    Attributes:
        host: Number of the host facet of each pair of facets, shape (num_pairs,).
        guest: Number of the guest facet of each pair, same shape.
        M: ∫φ_i N_l of each pair, shape (num_pairs, nodes of a host, nodes of a guest).
        along: Integrals ∫φ_i n N_l with the host's normal n, shape (num_pairs, nodes of a host,
            gdim, nodes of a guest). None if not requested, or if Ñ = N, whose coefficients are
            nodal values.
        d: Integrals ∫Ñ_i over the covered part of each host facet, shape (num_hosts, nodes).
        full: Integrals ∫Ñ_i over the whole host facet, same shape.
        covered: Covered length or area of the pieces of each host facet, shape (num_hosts,).
        whole: Length or area of all pieces, same shape.
        on_guest: Length or area of the covered part measured on the guest, same shape.
    """

    host: Longs
    guest: Longs
    M: Floats
    along: Floats | None
    d: Floats
    full: Floats
    covered: Floats
    whole: Floats
    on_guest: Floats


def integrate(
    hosts: Facets,
    guests: Facets,
    reach: float,
    around: Callable[[Floats], Floats],
    behind: float | None = None,
    along: bool = True,
) -> Integrals:
    """Return the integrals over the overlap of facets. Not collective.

    Args:
        hosts: Facets that carry multipliers, each on one rank.
        guests: All facets of the other surface within reach of the hosts.
        reach: Largest distance (length).
        around: Extent of host points out of the mesh's plane
            (:meth:`kinematics.Kinematics.around`).
        behind: Largest overlap (length); None for the value of ``reach``.
        along: Whether to integrate with the normal where functions are not N.
    """
    host, guest = pieces_of(hosts), pieces_of(guests)
    first, second = candidates(host, guest, reach, reach if behind is None else behind)
    (count, each), gdim = hosts["node"].shape, hosts["x"].shape[2]
    turns = turning(hosts)
    mass, d = np.zeros((count, each, each)), np.zeros((count, each))
    covered, on_guest = np.zeros((2, count))
    mixed_parts: list[_Sums] = []
    along_parts: list[_Sums] = []
    for chunk in _chunks(first):
        numbers = (first[chunk], second[chunk])
        part = _products(hosts, guests, (host, guest), numbers, turns, around)
        mixed_parts.append(part.mixed)
        along_parts.append(part.along)
        mass += part.mass
        d += part.d
        covered += part.covered
        on_guest += part.on_guest
    pair, mixed = _joined(mixed_parts)
    of_host, dual = pair // max(len(guests), 1), dual_factors(mass, d)
    normals = None
    if along and coupled(gdim, each):
        at_nodes = hosts["normal"]
        mixed_with = mixed[:, :, None, :] * at_nodes[of_host][:, :1, :, None]
        turned, values = _joined(along_parts)
        mixed_with[np.searchsorted(pair, turned)] = values.reshape(-1, *mixed_with.shape[1:])
        shape = mixed_with.shape
        normals = (dual[of_host] @ mixed_with.reshape(len(pair), each, gdim * each)).reshape(shape)
        own = d[:, :, None] * (np.linalg.inv(own_basis(gdim, each)).T @ at_nodes)
        normals = _balanced(normals, mixed, of_host, d, own)
    return Integrals(
        host=of_host,
        guest=pair % max(len(guests), 1),
        M=_balanced(dual[of_host] @ mixed, mixed, of_host, d, d),
        along=normals,
        d=d,
        full=_full(hosts, host, around),
        covered=covered,
        whole=_at(host.facet, count, host.measure),
        on_guest=on_guest,
    )


def _chunks(first: Longs) -> list[slice]:
    """Return at least one slice of a sorted list, split between different entries."""
    borders = [0]
    chunk = 50_000  # number of pairs of pieces that are clipped together
    while borders[-1] < len(first):
        last = min(borders[-1] + chunk, len(first)) - 1
        borders.append(int(np.searchsorted(first, first[last], side="right")))
    return [slice(*ends) for ends in pairwise(borders)] or [slice(0, 0)]


_Sums = tuple[Longs, Floats]
"""Keys of pairs of facets, and the data of each pair."""


@dataclass(frozen=True)
class _Products:
    """Integrals ∫ÑN and ∫ÑnN of pairs of facets, and ∫ÑÑ, ∫Ñ and ∫1 of each host, for some pieces.

    The integrals ∫ÑnN exist only for hosts along which n varies.
    """

    mixed: _Sums
    along: _Sums
    mass: Floats
    d: Floats
    covered: Floats
    on_guest: Floats


def _products(
    hosts: Facets,
    guests: Facets,
    pieces: tuple[Pieces, Pieces],
    numbers: tuple[Longs, Longs],
    turns: PairFlags,
    around: Callable[[Floats], Floats],
) -> _Products:
    (host, guest), (h, g) = pieces, numbers
    (count, each), gdim = hosts["node"].shape, hosts["x"].shape[2]
    found = overlaps(host.x[h], guest.x[g])
    h, g = h[found.pair], g[found.pair]
    near = _nearest(host, guest, h, g, found.host.mean(axis=1), found.guest.mean(axis=1))
    h, g = h[near], g[near]
    found = Overlaps(found.pair[near], found.host[near], found.guest[near], found.share[near])
    degree = 2 if each == gdim else 4
    at = overlap_points(hosts, guests, pieces, (h, g), found, degree)
    own, other = at.own @ own_basis(gdim, each).T, at.other
    weighted = own * (at.weight * around(at.x))[:, :, None]
    turned, e = weighted.transpose(0, 2, 1), at.host
    key, some = e * max(len(guests), 1) + at.guest, np.flatnonzero(turns[e])
    along = (at.normal[some][:, :, :, None] * other[some][:, :, None, :]).reshape(
        *other[some].shape[:2], gdim * each
    )
    cosine = np.abs(np.einsum("ni,ni->n", host.normal[h], guest.normal[g]))
    area = found.share * host.measure[h]
    return _Products(
        _added(key, turned @ other),
        _added(key[some], turned[some] @ along),
        _at(e, count, turned @ own),
        _at(e, count, weighted.sum(axis=1)),
        _at(e, count, area),
        _at(e, count, area / cosine),
    )


def _nearest(
    host: Pieces, guest: Pieces, h: Longs, g: Longs, in_host: Floats, in_guest: Floats
) -> Longs:
    """Return the overlaps with the first layer along the host's normal."""
    between = np.einsum("nc,nci->ni", in_guest, guest.x[g])
    between -= np.einsum("nc,nci->ni", in_host, host.x[h])
    far = np.abs(np.einsum("ni,ni->n", between, host.normal[h]))
    closest = np.full(len(host.facet), np.inf)
    np.minimum.at(closest, h, far)
    return np.flatnonzero(far <= closest[h] + 2 * (host.radius[h] + guest.radius[g]))


def _joined(parts: list[_Sums]) -> _Sums:
    keys, values = zip(*parts, strict=True)
    return _added(np.concatenate(keys), np.concatenate(values))


def _added(key: Longs, values: Floats) -> tuple[Longs, Floats]:
    """Return the distinct keys, sorted, and the sums of their values."""
    keys, group = np.unique(key, return_inverse=True)
    return keys, _at(group, len(keys), values)


def _at(group: Longs, count: int, values: Floats) -> Floats:
    """Return sums of values by group, shape (count, ...)."""
    every = np.arange(len(group) + 1)
    rows = csr_array((np.ones(len(group)), group, every), shape=(len(group), count)).T.tocsr()
    sums: Floats = (rows @ values.reshape(len(values), math.prod(values.shape[1:]))).reshape(
        count, *values.shape[1:]
    )
    return sums


def _balanced(M: Floats, mixed: Floats, of_host: Longs, d: Floats, own: Floats) -> Floats:
    """Return M corrected so that its rows sum to those of the host.

    Args:
        M: Where M_e is almost singular, the correction is a constant. The integrals ∫φ_i N_l or
            ∫φ_i n N_l of each pair have shape (num_pairs, i, ..., l).
        mixed: Integrals ∫Ñ_i N_l.
        of_host: Host facet of each pair.
        d: Integrals ∫Ñ_i of each host.
        own: Required sums of M, shape (num_hosts, i, ...).
    """
    missing = own - _at(of_host, len(d), M.sum(axis=-1))
    area = np.maximum(d.sum(axis=1), np.finfo(float).tiny).reshape(-1, *[1] * (own.ndim - 1))
    of_guest = mixed.sum(axis=1).reshape(len(M), *[1] * (M.ndim - 2), M.shape[-1])
    balanced: Floats = M + (missing / area)[of_host][..., None] * of_guest
    return balanced


def _full(hosts: Facets, pieces: Pieces, around: Callable[[Floats], Floats]) -> Floats:
    """Return ∫Ñ over whole facets."""
    (count, each), gdim = hosts["node"].shape, hosts["x"].shape[2]
    points, weights = rule(gdim, 2)
    at = points @ pieces.at
    x = hosts["x"][pieces.facet]
    weight = weights * pieces.measure[:, None]
    bent = pieces.curved
    weight[bent] = weights * pieces.part[bent, None] * area_elements(x[bent], at[bent])
    weight *= around(shape_functions(gdim, x.shape[1], at) @ x)
    own = shape_functions(gdim, each, at) @ own_basis(gdim, each).T
    return _at(pieces.facet, count, np.einsum("nq,nqi->ni", weight, own))
