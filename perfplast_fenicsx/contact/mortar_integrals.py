"""Integrals over the overlap of two surfaces with dual functions.

The multipliers live on the host's facets e. Over the covered part e' of each, the dual functions
φ = D_e M_e⁻¹ Ñ of the host's functions Ñ are biorthogonal to them, ∫φ_i Ñ_k = δ_ik ∫Ñ_k, and add up
to 1 (Cichosz and Bischoff, CMAME 200, 2011, doi 10.1016/j.cma.2010.11.004). So a row has one host
on its own surface, and its weights on the other one add up to the host's.

On triangles of second order vertices have functions N with ∫N = 0, which no multiplier can use. So
there Ñ_v = N_v + α Σ N_m over the midsides m next to v, and Ñ_m = (1 − 2α) N_m (Popp, Wohlmuth, Gee
and Wall, SIAM J. Sci. Comput. 34, 2012, doi 10.1137/110848190). α = 1/4 makes them Bernstein's
polynomials, which are nowhere negative: weights d stay positive whatever part is covered.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import basix
import numpy as np
from scipy.sparse import csr_array

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.contact.clipping import overlaps
from perfplast_fenicsx.contact.facet_pairing import candidates
from perfplast_fenicsx.contact.surface_facets import Facets, Pieces, pieces_of, shape_functions

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
        d: ∫Ñ_i over the covered part of each host facet, shape (num_hosts, nodes).
        full: ∫Ñ_i over the whole of it, same shape.
        covered: Covered length or area of each host facet, shape (num_hosts,).
        on_guest: The same part as measured on the guest, same shape.
    """

    host: Longs
    guest: Longs
    M: Floats
    d: Floats
    full: Floats
    covered: Floats
    on_guest: Floats


def own_basis(gdim: int, count: int) -> Floats:
    """Ñ = basis · N of a host facet, shape (count, count)."""
    basis = np.eye(count)
    if count == 6 and gdim == 3:
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
    count, each = hosts["node"].shape
    mass, d, covered = np.zeros((count, each, each)), np.zeros((count, each)), np.zeros(count)
    keys, products, on_guest = [], [], np.zeros(count)
    for chunk in _chunks(first):
        part = _products(hosts, guests, host, guest, first[chunk], second[chunk], around)
        keys.append(part.pair)
        products.append(part.mixed)
        mass += part.mass
        d += part.d
        covered += part.covered
        on_guest += part.on_guest
    pair, mixed = _added(np.concatenate(keys), np.concatenate(products))
    of_host = pair // max(len(guests), 1)
    return Integrals(
        host=of_host,
        guest=pair % max(len(guests), 1),
        M=_balanced(_dual(mass, d)[of_host] @ mixed, mixed, of_host, d),
        d=d,
        full=_whole(host, count, each, around),
        covered=covered,
        on_guest=on_guest,
    )


def _chunks(first: Longs) -> list[slice]:
    """Parts of a sorted list, between different entries; one at least."""
    borders = [0]
    while borders[-1] < len(first):
        last = min(borders[-1] + CHUNK, len(first)) - 1
        borders.append(int(np.searchsorted(first, first[last], side="right")))
    return [slice(*ends) for ends in pairwise(borders)] or [slice(0, 0)]


@dataclass(frozen=True)
class _Products:
    """∫ÑN of each pair of facets, and ∫ÑÑ, ∫Ñ and ∫1 of each host, of some pairs of pieces."""

    pair: Longs
    mixed: Floats
    mass: Floats
    d: Floats
    covered: Floats
    on_guest: Floats


def _products(
    hosts: Facets,
    guests: Facets,
    host: Pieces,
    guest: Pieces,
    first: Longs,
    second: Longs,
    around: Callable[[Floats], Floats],
) -> _Products:
    gdim, each = host.x.shape[1], hosts["node"].shape[1]
    found = overlaps(host.x[first], guest.x[second])
    h, g = first[found.pair], second[found.pair]
    area = found.share * host.measure[h]
    near = _nearest(host, guest, h, g, found.host.mean(axis=1), found.guest.mean(axis=1))
    h, g, area = h[near], g[near], area[near]
    points, weights = _rule(gdim, 2 if each == gdim else 4)

    def functions(pieces: Pieces, which: Longs, corners: Floats, count: int) -> Floats:
        at = points @ (corners[near] @ pieces.at[which])
        return shape_functions(gdim, count, at)

    own = functions(host, h, found.host, each) @ own_basis(gdim, each).T
    other = functions(guest, g, found.guest, each)
    rings = around(points @ (found.host[near] @ host.x[h]))
    weighted = own * (area[:, None] * weights * rings)[:, :, None]
    e, f = host.facet[h], guest.facet[g]
    turned = weighted.transpose(0, 2, 1)
    pair, mixed = _added(e * max(len(guests), 1) + f, turned @ other)
    cosine = np.abs(np.einsum("ni,ni->n", host.normal[h], guest.normal[g]))
    return _Products(
        pair,
        mixed,
        _at(e, len(hosts), turned @ own),
        _at(e, len(hosts), weighted.sum(axis=1)),
        _at(e, len(hosts), area),
        _at(e, len(hosts), area / cosine),
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


def _rule(gdim: int, degree: int) -> tuple[Floats, Floats]:
    """Barycentric points and weights, which add up to 1."""
    kind = basix.CellType.interval if gdim == 2 else basix.CellType.triangle
    points, weights = (np.asarray(one) for one in basix.make_quadrature(kind, degree))
    first = 1 - points.sum(axis=1, keepdims=True)
    return np.concatenate([first, points], axis=1), weights / weights.sum()


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


def _balanced(M: Floats, mixed: Floats, of_host: Longs, d: Floats) -> Floats:
    """M whose rows add up to d: where M_e can hardly be inverted, rounding is a constant in φ."""
    missing = d - _at(of_host, len(d), M.sum(axis=2))
    area = np.maximum(d.sum(axis=1, keepdims=True), np.finfo(float).tiny)
    balanced: Floats = M + (missing / area)[of_host][:, :, None] * mixed.sum(axis=1)[:, None, :]
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


def _whole(host: Pieces, count: int, each: int, around: Callable[[Floats], Floats]) -> Floats:
    """∫Ñ over whole facets."""
    gdim = host.x.shape[1]
    points, weights = _rule(gdim, 2)
    at = np.einsum("qc,ncr->nqr", points, host.at)
    own = shape_functions(gdim, each, at) @ own_basis(gdim, each).T
    rings = around(points @ host.x)
    return _at(host.facet, count, np.einsum("n,q,nq,nqi->ni", host.measure, weights, rings, own))
