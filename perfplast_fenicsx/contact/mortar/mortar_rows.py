"""Integrate dual functions over the overlap of two surfaces, and form the rows of mortar contact.

A node cannot have a multiplier if supports hold it or if its facets are almost entirely uncovered.
The same holds for a vertex of quadratic facets on an axis of revolution, where ∫Ñ is 0. Such a node
is retired: its function is given in equal parts to neighbours that can have a multiplier, before
the rows are divided by their weight d. The functions therefore still sum to 1, and forces and
moments balance.

The multipliers are defined on the facets e of the host surface, which may be partly covered. On the
covered part e' of each facet, the dual functions φ = D_e M_e⁻¹ Ñ are biorthogonal to the facet's
functions Ñ: ∫φ_i Ñ_k = δ_ik ∫Ñ_k. The φ sum to 1 (Cichosz and Bischoff, CMAME 200, 2011, doi
10.1016/j.cma.2010.11.004). If Ñ = N and no neighbour is retired, each row therefore has only one
node on the host surface, its host. In every row, the weights of the nodes on the guest surface sum
to the weight on the host surface.

On triangles of second order, the functions N of vertices have ∫N = 0, and no multiplier can use
them. On these triangles, the functions are Ñ_v = N_v + α Σ N_m over the midside nodes m next to v,
and Ñ_m = (1 − 2α) N_m (Popp, Wohlmuth, Gee and Wall, SIAM J. Sci. Comput. 34, 2012, doi
10.1137/110848190). With α = 1/4 they are Bernstein polynomials, which are nowhere negative. The
weights d are then positive, whatever part of a facet is covered.

The module sums the integrals of all overlapping pieces by pairs of facets, and multiplies them by
the factors D_e M_e⁻¹ of each host facet. If the host facet has Bernstein functions and its normal n
varies, the module also computes integrals with n, interpolated between the nodes. These integrals
are necessary because the coefficients of a displacement vector times a nodal normal differ by O(h²)
from the coefficients of the normal component.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array

from perfplast_fenicsx.arrays import Floats, Longs, PairFlags
from perfplast_fenicsx.contact.mortar.facet_overlap import (
    Overlaps,
    area_elements,
    candidates,
    overlap_points,
    overlaps,
    rule,
)
from perfplast_fenicsx.contact.surfaces.surface_facets import (
    EDGES,
    STRAIGHT,
    Facets,
    Pieces,
    pieces_of,
    shape_functions,
)
from perfplast_fenicsx.parallel import Exchange, send_rows


def coupled(gdim: int, count: int) -> bool:
    """Return whether the functions Ñ of a facet with ``count`` nodes differ from N."""
    return count == 6 and gdim == 3


def own_basis(gdim: int, count: int) -> Floats:
    """Return the matrix ``basis`` with Ñ = basis · N on a host facet, shape (count, count)."""
    basis = np.eye(count)
    if coupled(gdim, count):
        alpha = 0.25  # α of the functions on triangles of second order
        basis[3:, 3:] *= 1 - 2 * alpha
        for middle, ends in enumerate(EDGES[3], start=3):
            basis[ends, middle] = alpha
    return basis


def turning(hosts: Facets) -> PairFlags:
    """Return which facets have Ñ ≠ N and a varying normal, shape (num_hosts,)."""
    if not coupled(hosts["x"].shape[2], hosts["node"].shape[1]):
        return np.zeros(len(hosts), dtype=np.bool_)
    return np.asarray(np.ptp(hosts["normal"], axis=1).max(axis=1) > STRAIGHT)


def dual_factors(mass: Floats, d: Floats) -> Floats:
    """Return D_e M_e⁻¹ for each host facet, shape (num_hosts, nodes, nodes).

    If almost nothing of a facet is covered, M_e cannot be inverted. All functions of the facet are
    then constants, φ_i = d_i / |e'|, which preserve balance and constant pressures.

    Args:
        mass: M_e = ∫ÑÑ for each facet, same shape.
        d: Integrals ∫Ñ, shape (num_hosts, nodes).
    """
    diagonal = np.einsum("nii->ni", mass)
    size = np.sqrt(np.maximum(diagonal, np.finfo(float).tiny))
    scaled = mass / (size[:, :, None] * size[:, None, :])
    values, vectors = np.linalg.eigh(scaled)
    # Smallest eigenvalue for which the mass matrix of a facet, scaled to diagonal 1, is inverted.
    singular = 1e-14
    sound = (values[:, 0] > singular) & (d.sum(axis=1) > 0)
    roots = np.where(sound[:, None], values, 1.0)
    inverse = np.einsum("nij,nj,nkj->nik", vectors, 1 / roots, vectors)
    inverse /= size[:, :, None] * size[:, None, :]
    total = d.sum(axis=1)
    constant = d / np.where(total > 0, total, 1.0)[:, None]
    ones = np.broadcast_to(constant[:, :, None], mass.shape)
    dual: Floats = np.where(sound[:, None, None], d[:, :, None] * inverse, ones)
    return dual


@dataclass(frozen=True)
class Integrals:
    """Integrals over the host facets on this rank, for the nodes of these facets.

    Attributes:
        host: Number of the host facet of each pair of facets, shape (num_pairs,).
        guest: Number of the guest facet of each pair, same shape.
        M: ∫φ_i N_l for each pair, shape (num_pairs, nodes of a host facet, nodes of a guest facet).
        along: ∫φ_i n N_l with the host facet's normal n, shape (num_pairs, nodes of a host facet,
            gdim, nodes of a guest facet). None if not requested, or if Ñ = N, because coefficients
            are then nodal values.
        d: ∫Ñ_i over the covered part of each host facet, shape (num_hosts, nodes).
        full: ∫Ñ_i over the whole host facet, same shape.
        covered: Covered length or area of the pieces of each host facet, shape (num_hosts,).
        whole: Length or area of all pieces of each host facet, same shape.
        on_guest: Length or area of the covered part, measured on the guest, same shape.
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
        hosts: Facets with multipliers, each on one rank.
        guests: All facets of the other surface within ``reach`` of the hosts.
        reach: Largest distance between opposite facets (length).
        around: Function that returns the extent of host points out of the mesh plane
            (:meth:`kinematics.Kinematics.around`).
        behind: Largest overlap (length); None to use ``reach``.
        along: Whether to compute integrals with the normal if Ñ ≠ N.
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
    """Return slices (at least one) of a sorted list, which keep equal entries together."""
    borders = [0]
    chunk = 50_000  # number of pairs of pieces that are clipped together
    while borders[-1] < len(first):
        last = min(borders[-1] + chunk, len(first)) - 1
        borders.append(int(np.searchsorted(first, first[last], side="right")))
    return [slice(*ends) for ends in pairwise(borders)] or [slice(0, 0)]


_Sums = tuple[Longs, Floats]
"""Keys of pairs of facets, and the data for each pair."""


@dataclass(frozen=True)
class _Products:
    """Integrals over some pieces: ∫ÑN and ∫ÑnN for pairs of facets; ∫ÑÑ, ∫Ñ, ∫1 for host facets.

    The integrals ∫ÑnN exist only for host facets with a varying normal n.
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
    """Return indices of overlaps whose guest is in the first layer that the host's normal meets."""
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
    """Return the distinct keys, sorted, and the sum of the values for each key."""
    keys, group = np.unique(key, return_inverse=True)
    return keys, _at(group, len(keys), values)


def _at(group: Longs, count: int, values: Floats) -> Floats:
    """Return the sums of values by group, shape (count, ...)."""
    every = np.arange(len(group) + 1)
    rows = csr_array((np.ones(len(group)), group, every), shape=(len(group), count)).T.tocsr()
    sums: Floats = (rows @ values.reshape(len(values), math.prod(values.shape[1:]))).reshape(
        count, *values.shape[1:]
    )
    return sums


def _balanced(M: Floats, mixed: Floats, of_host: Longs, d: Floats, own: Floats) -> Floats:
    """Return M, corrected so that its sums over guests equal the required sums ``own``.

    The correction is constant on a facet; it is large only where M_e is almost singular.

    Args:
        M: Integrals ∫φ_i N_l or ∫φ_i n N_l for each pair, shape (num_pairs, i, ..., l).
        mixed: Integrals ∫Ñ_i N_l for each pair.
        of_host: Number of the host facet in each pair.
        d: Integrals ∫Ñ_i for each host facet.
        own: Required sums of M, shape (num_hosts, i, ...).
    """
    missing = own - _at(of_host, len(d), M.sum(axis=-1))
    area = np.maximum(d.sum(axis=1), np.finfo(float).tiny).reshape(-1, *[1] * (own.ndim - 1))
    of_guest = mixed.sum(axis=1).reshape(len(M), *[1] * (M.ndim - 2), M.shape[-1])
    balanced: Floats = M + (missing / area)[of_host][..., None] * of_guest
    return balanced


def _full(hosts: Facets, pieces: Pieces, around: Callable[[Floats], Floats]) -> Floats:
    """Return ∫Ñ over the whole of each host facet."""
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


@dataclass(frozen=True)
class MortarRows:
    """Rows Σ weight · u for the nodes of this rank, divided by d.

    Attributes:
        place: Index of each host among this rank's nodes of the surface, shape (num_rows,).
        d: ∫Ñ of each host, including the parts of retired neighbours (length or area), shape
            (num_rows,).
        row: Row number of each term, shape (num_terms,).
        node: Global block dof of each term.
        weight: Weight of each term. In each row, the weights on the host's surface sum to 1 and the
            others to −1.
        along: Weight times normal for each term if the normal varies between nodes, shape
            (num_terms, gdim); None if all terms use the host's normal.
        own: Whether the term belongs to the host's surface.
        lost: Number of covered nodes on all ranks that can neither have a multiplier nor transfer
            it.
    """

    place: Longs
    d: Floats
    row: Longs
    node: Longs
    weight: Floats
    along: Floats | None
    own: npt.NDArray[np.bool_]
    lost: int

    def coefficients(self, normal: Floats) -> Floats:
        """Return the coefficients of the terms in the normal jumps, shape (num_terms, gdim).

        Args:
            normal: Normal at the host of each row, shape (num_rows, gdim).
        """
        return self.weight[:, None] * normal[self.row] if self.along is None else self.along


def mortar_rows(
    comm: MPI.Intracomm, hosts: Facets, guests: Facets, found: Integrals, able: PairFlags
) -> MortarRows:
    """Return the mortar rows from the integrals. Collective.

    Args:
        comm: Communicator of the ranks.
        hosts: The host facets on this rank.
        guests: The guest facets.
        found: Integrals over the overlaps of both.
        able: Whether supports allow each owned node of the host surface to host.
    """
    count, each = len(able), hosts["node"].shape[1]
    corners = Exchange(comm, hosts["rank"].ravel())
    place = corners.forward(hosts["place"].ravel())

    def summed(values: Floats) -> Floats:
        return _sums(place, corners.forward(values.ravel()), count)

    d = summed(found.d)
    touched = summed(np.repeat(found.covered > 0, each).astype(np.float64)) > 0
    around = summed(np.repeat(np.abs(found.d).sum(axis=1), each))
    # Weights in a row count as rounding errors up to this size, and so does d relative to the
    # surrounding ∫|Ñ|.
    rounding = 1e-14
    able = able & touched & (d > rounding * around)
    # A node can have a multiplier if at least this fraction of its function is on the covered part.
    least_covered = 0.1
    fit = able & (d >= least_covered * summed(found.full))
    heirs = _heirs(comm, hosts, found, corners, place, fit)
    provided = _among(count, heirs["place"])
    fit = fit | (able & ~provided)  # barely covered nodes without heirs host too
    more = _heirs(comm, hosts, found, corners, place, fit)
    heirs = np.sort(np.concatenate([heirs, more[~provided[more["place"]]]]), order="place")
    lost = touched & ~fit & ~_among(count, heirs["place"])

    terms = send_rows(comm, *_terms(hosts, guests, found))
    stay = fit[terms["place"]]
    handed = send_rows(comm, *_handed_on(terms[~stay], heirs))
    place, own, node, value, along = _compressed(np.concatenate([terms[stay], handed]))
    weight_of = _sums(place[own], value[own], count)
    divisor = np.where(fit, weight_of, 1.0)[place]
    weight, along = value / divisor, along / divisor[:, None]
    kept = np.maximum(np.abs(weight), np.abs(along).max(axis=1, initial=0)) > rounding
    number = np.cumsum(fit) - 1
    places = np.flatnonzero(fit)
    return MortarRows(
        places,
        weight_of[places],
        number[place[kept]],
        node[kept],
        weight[kept],
        None if found.along is None else along[kept],
        own[kept],
        comm.allreduce(int(lost.sum())),
    )


def _sums(group: Longs, values: Floats, count: int) -> Floats:
    return np.asarray(np.bincount(group, values, count), dtype=np.float64)


def _among(count: int, places: Longs) -> PairFlags:
    flags = np.zeros(count, dtype=np.bool_)
    flags[places] = True
    return flags


def _heirs(
    comm: MPI.Intracomm,
    hosts: Facets,
    found: Integrals,
    corners: Exchange,
    place: Longs,
    fit: PairFlags,
) -> npt.NDArray[np.void]:
    """Return the heirs of unfit nodes on this rank: fit nodes of the same covered facets.

    Collective.

    Args:
        comm: Communicator of the ranks.
        hosts: The host facets on this rank.
        found: Integrals over the overlaps.
        corners: Map from the corners of facets to the owners of the nodes.
        place: Index on this rank of the node that each corner on any rank refers to.
        fit: Whether each node of this rank has a multiplier.

    Returns:
        Rows with the ``place`` (index) of a node on this rank, and the ``rank`` and ``heir`` (index
        on that rank) of each node that takes over; sorted by place, without repetition.
    """
    fits = corners.back(fit[place]).reshape(hosts["node"].shape)
    may = (~fits & (found.covered > 0)[:, None])[:, :, None] & fits[:, None, :]
    if coupled(hosts["x"].shape[2], hosts["node"].shape[1]):
        for middle, ends in enumerate(
            EDGES[3], start=3
        ):  # so that heirs do not refer to each other in a ring
            may[:, middle, :3] &= ~np.any(fits[:, ends], axis=1, keepdims=True)
    facet, old, new = np.nonzero(may)
    rows = np.empty(len(facet), dtype=[("place", np.int64), ("rank", np.int32), ("heir", np.int64)])
    rows["place"] = hosts["place"][facet, old]
    rows["rank"] = hosts["rank"][facet, new]
    rows["heir"] = hosts["place"][facet, new]
    return np.unique(send_rows(comm, rows, hosts["rank"][facet, old]))


def _term_type(gdim: int, found: Integrals) -> np.dtype:
    """Return the structured type of a term in a node's row, before division by d.

    The field ``value`` multiplies the displacement. The field ``along`` is the value times the
    varying normal.
    """
    return np.dtype(
        [
            ("place", np.int64),
            ("own", np.bool_),
            ("node", np.int64),
            ("value", np.float64),
            ("along", np.float64, 0 if found.along is None else gdim),
        ]
    )


def _terms(
    hosts: Facets, guests: Facets, found: Integrals
) -> tuple[npt.NDArray[np.void], npt.NDArray[np.integer]]:
    """Return all terms of the facets on this rank, and the rank to which each term goes."""
    each, gdim = hosts["node"].shape[1], hosts["x"].shape[2]
    basis = np.linalg.inv(own_basis(gdim, each)).T
    facet, i, k = np.nonzero(found.d[:, :, None] * basis)
    own = np.zeros(len(facet), dtype=_term_type(gdim, found))
    own["place"], own["own"] = hosts["place"][facet, i], True
    own["node"], own["value"] = hosts["node"][facet, k], found.d[facet, i] * basis[i, k]
    some = found.M != 0
    if found.along is not None:
        some |= (found.along != 0).any(axis=2)
        own["along"] = own["value"][:, None] * hosts["normal"][facet, k]
    pair, j, m = np.nonzero(some)
    of_host, of_guest = found.host[pair], found.guest[pair]
    other = np.zeros(len(pair), dtype=_term_type(gdim, found))
    other["place"], other["own"] = hosts["place"][of_host, j], False
    other["node"], other["value"] = guests["node"][of_guest, m], -found.M[pair, j, m]
    if found.along is not None:
        other["along"] = -found.along[pair, j, :, m]
    ranks = (hosts["rank"][facet, i], hosts["rank"][of_host, j])
    return np.concatenate([own, other]), np.concatenate(ranks)


def _handed_on(
    terms: npt.NDArray[np.void], heirs: npt.NDArray[np.void]
) -> tuple[npt.NDArray[np.void], npt.NDArray[np.integer]]:
    """Return the terms of retired nodes, divided equally among heirs, and the heirs' ranks."""
    begin = np.searchsorted(heirs["place"], terms["place"], side="left")
    count = np.searchsorted(heirs["place"], terms["place"], side="right") - begin
    within = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    heir = heirs[np.repeat(begin, count) + within]
    handed = np.repeat(terms, count)
    handed["value"] /= np.repeat(count, count)
    handed["along"] /= np.repeat(count, count)[:, None]
    handed["place"] = heir["heir"]
    return handed, heir["rank"]


def _compressed(
    terms: npt.NDArray[np.void],
) -> tuple[Longs, npt.NDArray[np.bool_], Longs, Floats, Floats]:
    """Return place, ``own``, node and the sums of value and ``along``, for each row and node."""
    span = int(terms["node"].max(initial=0)) + 1
    key = (terms["place"] * 2 + terms["own"]) * span + terms["node"]
    keys, group = np.unique(key, return_inverse=True)
    value = _sums(group, terms["value"], len(keys))
    along = [_sums(group, one, len(keys)) for one in terms["along"].T]
    row, node = np.divmod(keys, span)
    columns = np.array(along).reshape(len(along), len(keys)).T
    return row // 2, (row % 2).astype(np.bool_), node, value, columns
