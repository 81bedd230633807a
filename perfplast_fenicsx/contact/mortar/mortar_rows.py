"""Form the rows of mortar contact, sum them on the owners of hosts, and replace unfit hosts.

A node cannot carry a multiplier if almost none of it is covered or if supports hold it. The same
holds for a vertex of quadratic facets on an axis of revolution, where ∫Ñ is 0. Such a node is
retired: its function goes in equal parts to neighbours that can carry a multiplier, before the rows
are divided by their weight d. So the functions still sum to 1, and forces and moments balance.
"""

from dataclasses import dataclass

from mpi4py import MPI

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats, Longs, PairFlags
from perfplast_fenicsx.contact.mortar.dual_functions import coupled, own_basis
from perfplast_fenicsx.contact.mortar.mortar_integrals import Integrals
from perfplast_fenicsx.contact.surfaces.surface_facets import EDGES, Facets
from perfplast_fenicsx.parallel import Exchange, send_rows


@dataclass(frozen=True)
class MortarRows:
    """Rows Σ weight · u of this rank's nodes, divided by d.

    Attributes:
        place: Index of each host in this rank's nodes of the surface, shape (num_rows,).
        d: ∫Ñ of each host including retired neighbours' parts (length, area), shape (num_rows,).
        row: Row of each term, shape (num_terms,).
        node: Global block dof of each term.
        weight: Weight of each term; in a row, those of the host's surface sum to 1, the others to
            −1.
        along: Weight times normal of each term, if the normal varies between nodes, shape
            (num_terms, gdim); None if it is the host's normal.
        own: Whether the term belongs to the host's surface.
        lost: Number of covered nodes on all ranks that can neither carry a multiplier nor transfer
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
        """Return the factors of the terms of normal jumps, shape (num_terms, gdim).

        Args:
            normal: Normal of each row's host, shape (num_rows, gdim).
        """
        return self.weight[:, None] * normal[self.row] if self.along is None else self.along


def mortar_rows(
    comm: MPI.Intracomm, hosts: Facets, guests: Facets, found: Integrals, able: PairFlags
) -> MortarRows:
    """Return the rows that follow from integrals. Collective.

    Args:
        comm: The ranks.
        hosts: The host facets on this rank.
        guests: The guest facets.
        found: Their integrals.
        able: For each owned node of the host surface, whether supports let it host.
    """
    count, each = len(able), hosts["node"].shape[1]
    corners = Exchange(comm, hosts["rank"].ravel())
    place = corners.forward(hosts["place"].ravel())

    def summed(values: Floats) -> Floats:
        return _sums(place, corners.forward(values.ravel()), count)

    d = summed(found.d)
    touched = summed(np.repeat(found.covered > 0, each).astype(np.float64)) > 0
    around = summed(np.repeat(np.abs(found.d).sum(axis=1), each))
    # Weights of a row, and shares of a node in the surrounding ∫Ñ, up to this size are rounding
    # errors.
    rounding = 1e-14
    able = able & touched & (d > rounding * around)
    # A node carries a multiplier if this share of its function is on the covered part.
    least_covered = 0.1
    fit = able & (d >= least_covered * summed(found.full))
    heirs = _heirs(comm, hosts, found, corners, place, fit)
    provided = _among(count, heirs["place"])
    fit = fit | (able & ~provided)  # these nodes replace others only if no other node can
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
    """Return the heirs of this rank's unfit nodes: fit nodes of the same covered facets.

    Collective.

    Args:
        comm: The ranks.
        hosts: The host facets on this rank.
        found: Their integrals.
        corners: Map from corners of facets to the owners of nodes.
        place: Index on this rank of the node that each corner of any rank refers to.
        fit: Nodes of this rank that carry multipliers.

    Returns:
        Rows with the ``place`` (index) of a node of this rank, and the ``rank`` and ``heir`` (index
        there) of each node that replaces it; sorted by place, without repetition.
    """
    fits = corners.back(fit[place]).reshape(hosts["node"].shape)
    may = (~fits & (found.covered > 0)[:, None])[:, :, None] & fits[:, None, :]
    if coupled(hosts["x"].shape[2], hosts["node"].shape[1]):
        for middle, ends in enumerate(
            EDGES[3], start=3
        ):  # so that chain ends do not refer to each other in a ring
            may[:, middle, :3] &= ~np.any(fits[:, ends], axis=1, keepdims=True)
    facet, old, new = np.nonzero(may)
    rows = np.empty(len(facet), dtype=[("place", np.int64), ("rank", np.int32), ("heir", np.int64)])
    rows["place"] = hosts["place"][facet, old]
    rows["rank"] = hosts["rank"][facet, new]
    rows["heir"] = hosts["place"][facet, new]
    return np.unique(send_rows(comm, rows, hosts["rank"][facet, old]))


def _term_type(gdim: int, found: Integrals) -> np.dtype:
    """Return the structured type of a term in the row of a node, before division by d.

    The field ``value`` multiplies displacements. The field ``along`` multiplies them together with
    varying normals.
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
    """Return all terms of the facets on this rank, and their destination ranks."""
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
    """Return the terms of retired nodes, in equal parts for each of their heirs."""
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
    """Return place, side, node, value and along of the terms, summed by node and row."""
    span = int(terms["node"].max(initial=0)) + 1
    key = (terms["place"] * 2 + terms["own"]) * span + terms["node"]
    keys, group = np.unique(key, return_inverse=True)
    value = _sums(group, terms["value"], len(keys))
    along = [_sums(group, one, len(keys)) for one in terms["along"].T]
    row, node = np.divmod(keys, span)
    columns = np.array(along).reshape(len(along), len(keys)).T
    return row // 2, (row % 2).astype(np.bool_), node, value, columns
