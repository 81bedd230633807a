"""Match facets of two surfaces that lie on each other, or face each other along their normal."""

from dataclasses import dataclass

from mpi4py import MPI

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Longs
from perfplast_fenicsx.contact.surfaces.node_matching import match_nodes
from perfplast_fenicsx.limit_analysis.facets.facing_vertices import REACH, facing_vertices, fit
from perfplast_fenicsx.parallel import bounding_box, send_rows

Flags = npt.NDArray[np.bool_]

FacetRows = npt.NDArray[np.void]
"""Facets of a surface, rows of :func:`facet_type`."""


def facet_type(gdim: int) -> np.dtype:
    """Return the type of a row.

    The fields are:

    - ``x``: the midpoint (3 numbers),
    - ``normal``: the outward unit normal,
    - ``corners``: the vertices in the order of their global numbers,
    - ``rank``: the rank that owns the facet,
    - ``facet`` and ``number``: its local and its global number,
    - ``held``: flags of the components that supports hold,
    - ``free``: whether supports leave it free along the normal.
    """
    return np.dtype(
        [
            ("x", np.float64, 3),
            ("normal", np.float64, gdim),
            ("corners", np.float64, (gdim, gdim)),
            ("rank", np.int32),
            ("facet", np.int32),
            ("number", np.int64),
            ("held", np.bool_, gdim),
            ("free", np.bool_),
        ]
    )


@dataclass(frozen=True)
class FacetPairs:
    """Pairs of facets.

    Attributes:
        host: Owned facets whose velocity along the normal becomes a jump, shape (num_pairs,).
        guest: Unknown along the normal that the jump is relative to, at each of the host's
            vertices, shape (num_pairs, d); −1 where supports hold the other side.
        aligned: Flags of components that supports hold on either side, by host, shape (num_pairs,
            d).
        turned: Owned facets that are guests, whose normal becomes that of the host.
        turned_aligned: The flags of ``aligned``, by guest.
        both_held: Whether supports hold components on both sides of any pair of this rank.
    """

    host: Longs
    guest: Longs
    aligned: Flags
    turned: Longs
    turned_aligned: Flags
    both_held: bool


def pair_facets(
    comm: MPI.Intracomm, primary: FacetRows, secondary: FacetRows, turned: bool = False
) -> FacetPairs | None:
    """Match the facets of two surfaces. Collective.

    Args:
        comm: The ranks.
        primary: Facets of one surface that this rank owns.
        secondary: Facets of the other surface that this rank owns.
        turned: Whether they are sections of rings, which match only at equal radii.

    Returns:
        The pairs; None if the surfaces do not match facet by facet.
    """
    gdim = primary["normal"].shape[1]
    corners = np.concatenate([primary["corners"], secondary["corners"]]).reshape(-1, gdim)
    low, high = bounding_box(comm, np.pad(corners, ((0, 0), (0, 3 - gdim))))
    found = match_nodes(comm, primary, secondary, REACH * float(np.linalg.norm(high - low)))
    a, b = found.primary, found.secondary
    order, off = facing_vertices(a["corners"], b["corners"], a["normal"], turned)
    same = bool(fit(a["corners"], off, a["normal"], b["normal"]).all())
    if found.alone or not comm.allreduce(same, MPI.LAND):
        return None
    return _to_owners(comm, a, b, order)


def _to_owners(comm: MPI.Intracomm, a: FacetRows, b: FacetRows, order: Longs) -> FacetPairs:
    """Send pairs to the owners of both facets. Collective.

    The host is the first facet, unless supports hold more of its components than of the other's.
    """
    gdim = order.shape[1]
    flags = ("aligned", np.bool_, gdim)
    host_type = [("facet", np.int64), ("guest", np.int64, gdim), flags, ("rank", np.int64)]
    both = a["free"] & b["free"]
    swapped = np.where(both, b["held"].sum(axis=1) < a["held"].sum(axis=1), ~a["free"])
    back = np.argsort(order, axis=1)
    host, guest = (np.where(swapped, *pair) for pair in ((b, a), (a, b)))
    aligned = np.where(both[:, None], a["held"] | b["held"], host["held"])
    order = np.where(swapped[:, None], back, order)
    hosts = np.empty(len(a), dtype=np.dtype(host_type))
    hosts["facet"], hosts["rank"], hosts["aligned"] = host["facet"], host["rank"], aligned
    numbers = (guest["number"][:, None] * gdim + order) * gdim
    hosts["guest"] = np.where(both[:, None], numbers, -1)
    hosts = hosts[a["free"] | b["free"]]
    guests = np.empty(len(a), dtype=np.dtype([("facet", np.int64), flags]))
    guests["facet"], guests["aligned"] = guest["facet"], aligned
    mine = send_rows(comm, hosts, hosts["rank"])
    turned = send_rows(comm, guests[both], guest["rank"][both])
    both_held = bool((a["held"].any(axis=1) & b["held"].any(axis=1)).any())
    return FacetPairs(
        host=mine["facet"],
        guest=mine["guest"],
        aligned=mine["aligned"],
        turned=turned["facet"],
        turned_aligned=turned["aligned"],
        both_held=both_held,
    )
