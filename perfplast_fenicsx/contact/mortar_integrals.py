"""Integrals over the overlap of two surfaces with dual functions.

The multipliers live on the host's facets e. Over the covered part e' of each, the dual functions
φ = D_e M_e⁻¹ Ñ of the host's functions Ñ are biorthogonal to them, ∫φ_i Ñ_k = δ_ik ∫Ñ_k, and add up
to 1 (Cichosz and Bischoff, CMAME 200, 2011, doi 10.1016/j.cma.2010.11.004). So a row has one host
on its own surface, and its weights on the other one add up to the host's.

On triangles of second order vertices have functions N with ∫N = 0, which no multiplier can use. So
there Ñ_v = N_v + α Σ N_m over the midsides m next to v, and Ñ_m = (1 − 2α) N_m (Popp, Wohlmuth, Gee
and Wall, SIAM J. Sci. Comput. 34, 2012, doi 10.1137/110848190). α = 1/4 makes them Bernstein's
polynomials, which are nowhere negative: weights d stay positive whatever part is covered.

Coefficients of these polynomials are not values at nodes: those of a surface's displacement, a
vector, times the node's normal are not those of its normal component where the normal n turns, but
miss them by O(h²). So M is had with n too, interpolated between the nodes: ∫φ_i n N_l.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.sparse import csr_array

from perfplast_fenicsx.arrays import Floats, Longs, PairFlags
from perfplast_fenicsx.contact.clipping import Overlaps, overlaps
from perfplast_fenicsx.contact.facet_pairing import candidates
from perfplast_fenicsx.contact.overlap_points import area_elements, overlap_points, rule
from perfplast_fenicsx.contact.surface_facets import (
    STRAIGHT,
    Facets,
    Pieces,
    pieces_of,
    shape_functions,
)

ALPHA = 0.25
"""α of the functions on triangles of second order."""

ENDS = ((1, 2), (0, 2), (0, 1))
"""Vertices at the ends of each edge of a triangle, in the order of its midsides."""

CHUNK = 50_000
"""Pairs of pieces that are clipped at once."""

SINGULAR = 1e-14
"""Smallest eigenvalue of a facet's mass matrix, scaled to a diagonal of 1, that is inverted."""


@dataclass(frozen=True)
class Integrals:
    """What the facets that met on this rank have to say to the nodes of the host.

    Attributes:
        host: Number of the host facet of each pair of facets, shape (num_pairs,).
        guest: Of the guest facet.
        M: ∫φ_i N_l of each pair, shape (num_pairs, nodes of a host, nodes of a guest).
        along: ∫φ_i n N_l with the host's normal n, shape (num_pairs, nodes of a host, gdim, nodes
            of a guest); None where the Ñ are the N, whose coefficients are values at nodes.
        d: ∫Ñ_i over the covered part of each host facet, shape (num_hosts, nodes).
        full: ∫Ñ_i over the whole of it, same shape.
        covered: Covered length or area of the pieces of each host facet, shape (num_hosts,).
        whole: Length or area of all of them, same shape.
        on_guest: The covered part as measured on the guest, same shape.
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


def coupled(gdim: int, count: int) -> bool:
    """Whether the Ñ of a host facet with so many nodes are not its N."""
    return count == 6 and gdim == 3


def own_basis(gdim: int, count: int) -> Floats:
    """Ñ = basis · N of a host facet, shape (count, count)."""
    basis = np.eye(count)
    if coupled(gdim, count):
        basis[3:, 3:] *= 1 - 2 * ALPHA
        for middle, ends in enumerate(ENDS, start=3):
            basis[ends, middle] = ALPHA
    return basis


def integrate(
    hosts: Facets,
    guests: Facets,
    reach: float,
    around: Callable[[Floats], Floats],
    behind: float | None = None,
) -> Integrals:
    """Integrate over the overlap of facets. Not collective.

    Args:
        hosts: Facets that carry multipliers, each on one rank.
        guests: All facets of the other surface within reach of them.
        reach: Largest distance (length).
        around: What points of the host stand for out of the mesh's plane
            (:meth:`kinematics.Kinematics.around`).
        behind: Largest overlap (length); None for the same.
    """
    host, guest = pieces_of(hosts), pieces_of(guests)
    first, second = candidates(host, guest, reach, reach if behind is None else behind)
    (count, each), gdim = hosts["node"].shape, hosts["x"].shape[2]
    turning = coupled(gdim, each) & (np.ptp(hosts["normal"], axis=1).max(axis=1) > STRAIGHT)
    mass, d = np.zeros((count, each, each)), np.zeros((count, each))
    covered, on_guest = np.zeros((2, count))
    mixed_parts: list[_Sums] = []
    along_parts: list[_Sums] = []
    for chunk in _chunks(first):
        numbers = (first[chunk], second[chunk])
        part = _products(hosts, guests, (host, guest), numbers, turning, around)
        mixed_parts.append(part.mixed)
        along_parts.append(part.along)
        mass += part.mass
        d += part.d
        covered += part.covered
        on_guest += part.on_guest
    pair, mixed = _joined(mixed_parts)
    of_host, dual = pair // max(len(guests), 1), _dual(mass, d)
    along = None
    if coupled(gdim, each):
        normal = hosts["normal"]
        along = mixed[:, :, None, :] * normal[of_host][:, :1, :, None]
        turned, values = _joined(along_parts)
        along[np.searchsorted(pair, turned)] = values.reshape(-1, *along.shape[1:])
        along = (dual[of_host] @ along.reshape(len(pair), each, gdim * each)).reshape(along.shape)
        own = d[:, :, None] * (np.linalg.inv(own_basis(gdim, each)).T @ normal)
        along = _balanced(along, mixed, of_host, d, own)
    return Integrals(
        host=of_host,
        guest=pair % max(len(guests), 1),
        M=_balanced(dual[of_host] @ mixed, mixed, of_host, d, d),
        along=along,
        d=d,
        full=_full(hosts, host, around),
        covered=covered,
        whole=_at(host.facet, count, host.measure),
        on_guest=on_guest,
    )


def _chunks(first: Longs) -> list[slice]:
    """Parts of a sorted list, between different entries; one at least."""
    borders = [0]
    while borders[-1] < len(first):
        last = min(borders[-1] + CHUNK, len(first)) - 1
        borders.append(int(np.searchsorted(first, first[last], side="right")))
    return [slice(*ends) for ends in pairwise(borders)] or [slice(0, 0)]


_Sums = tuple[Longs, Floats]
"""Keys of pairs of facets, and what each pair has."""


@dataclass(frozen=True)
class _Products:
    """∫ÑN and ∫ÑnN of pairs of facets, and ∫ÑÑ, ∫Ñ and ∫1 of each host, of some pairs of pieces.

    ∫ÑnN is that of hosts along which n turns.
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
    turning: PairFlags,
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
    own = shape_functions(gdim, each, at.at_host) @ own_basis(gdim, each).T
    other = shape_functions(gdim, each, at.at_guest)
    weighted = own * (at.weight * around(at.x))[:, :, None]
    turned, e = weighted.transpose(0, 2, 1), at.host
    key, some = e * max(len(guests), 1) + at.guest, np.flatnonzero(turning[e])
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
    """The overlaps that are with the first layer met along the host's normal."""
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
    """Distinct keys, sorted, and the sums of their values."""
    keys, group = np.unique(key, return_inverse=True)
    return keys, _at(group, len(keys), values)


def _at(group: Longs, count: int, values: Floats) -> Floats:
    """Sums of values by group, shape (count, ...)."""
    every = np.arange(len(group) + 1)
    rows = csr_array((np.ones(len(group)), group, every), shape=(len(group), count)).T.tocsr()
    sums: Floats = (rows @ values.reshape(len(values), math.prod(values.shape[1:]))).reshape(
        count, *values.shape[1:]
    )
    return sums


def _balanced(M: Floats, mixed: Floats, of_host: Longs, d: Floats, own: Floats) -> Floats:
    """M whose rows add up to the host's: rounding, where M_e can hardly be inverted, is a constant.

    Args:
        M: ∫φ_i N_l or ∫φ_i n N_l of each pair, shape (num_pairs, i, ..., l).
        mixed: ∫Ñ_i N_l.
        of_host: Host facet of each pair.
        d: ∫Ñ_i of each host.
        own: What M adds up to, shape (num_hosts, i, ...).
    """
    missing = own - _at(of_host, len(d), M.sum(axis=-1))
    area = np.maximum(d.sum(axis=1), np.finfo(float).tiny).reshape(-1, *[1] * (own.ndim - 1))
    of_guest = mixed.sum(axis=1).reshape(len(M), *[1] * (M.ndim - 2), M.shape[-1])
    balanced: Floats = M + (missing / area)[of_host][..., None] * of_guest
    return balanced


def _dual(mass: Floats, d: Floats) -> Floats:
    """D_e M_e⁻¹ of each host facet.

    Where next to nothing of a facet is covered M_e cannot be inverted. All its functions then are
    constants, φ_i = d_i / |e'|: they keep balance and constant pressures.
    """
    diagonal = np.einsum("nii->ni", mass)
    size = np.sqrt(np.maximum(diagonal, np.finfo(float).tiny))
    scaled = mass / (size[:, :, None] * size[:, None, :])
    values, vectors = np.linalg.eigh(scaled)
    sound = (values[:, 0] > SINGULAR) & (d.sum(axis=1) > 0)
    roots = np.where(sound[:, None], values, 1.0)
    inverse = np.einsum("nij,nj,nkj->nik", vectors, 1 / roots, vectors)
    inverse /= size[:, :, None] * size[:, None, :]
    total = d.sum(axis=1)
    constant = d / np.where(total > 0, total, 1.0)[:, None]
    ones = np.broadcast_to(constant[:, :, None], mass.shape)
    dual: Floats = np.where(sound[:, None, None], d[:, :, None] * inverse, ones)
    return dual


def _full(hosts: Facets, pieces: Pieces, around: Callable[[Floats], Floats]) -> Floats:
    """∫Ñ over whole facets."""
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
