"""Measure the distances of one surface's nodes from the other surface along their normals."""

from dataclasses import dataclass
from typing import Any

from mpi4py import MPI

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.contact.mortar.dual_functions import coupled, own_basis
from perfplast_fenicsx.contact.mortar.mortar_integrals import Integrals
from perfplast_fenicsx.contact.surfaces.surface_facets import Facets, shape_functions
from perfplast_fenicsx.parallel import Exchange, send_rows


@dataclass(frozen=True)
class Distances:
    """Distances of the nodes of this rank from the other surface.

    Attributes:
        along: Distance along the node's normal, negative for a node inside; inf if nothing is
            opposite. Shape (num_nodes,).
        slack: Geometric error of the facets (length): two curved surfaces in contact may appear
            apart, or overlapping, by this much, because facets differ from the curved surfaces.
    """

    along: Floats
    slack: Floats


def distances(
    comm: MPI.Intracomm, hosts: Facets, guests: Facets, found: Integrals, count: int
) -> Distances:
    """Return the distances from each corner of a host facet to the guest facets that it overlaps.

    Collective.

    The distance uses the guest facet that the normal meets. If it meets none, as at the border of
    the covered part, the plane or curve of the nearest facet is extended.

    Args:
        comm: The ranks.
        hosts: The host facets on this rank.
        guests: The guest facets.
        found: Their overlaps.
        count: Number of nodes of the host surface that this rank owns.
    """
    each = hosts["node"].shape[1]
    h, g = np.repeat(found.host, each), np.repeat(found.guest, each)
    corner = np.tile(np.arange(each), len(found.host))
    aside, along = _met(hosts["at"][h, corner], hosts["normal"][h, corner], guests["x"][g])
    rows: npt.NDArray[np.void] = np.empty(
        len(h),
        dtype=[("place", np.int64), ("aside", np.float64), ("along", np.float64), ("slack", "f8")],
    )
    rows["place"], rows["aside"], rows["along"] = hosts["place"][h, corner], aside, along
    rows["slack"] = _sagitta(hosts)[h] + _sagitta(guests)[g]
    rows = send_rows(comm, rows, hosts["rank"][h, corner])
    sideways = 1e-9  # a normal that misses a facet by this share of its size still meets it
    order = np.lexsort([np.abs(rows["along"]), np.maximum(rows["aside"], sideways), rows["place"]])
    rows = rows[order]
    place, first = np.unique(rows["place"], return_index=True)
    result = Distances(np.full(count, np.inf), np.zeros(count))
    result.along[place] = rows["along"][first]
    np.maximum.at(result.slack, rows["place"], rows["slack"])
    return result


def in_basis(comm: MPI.Intracomm, hosts: Facets, found: Integrals, gap: Floats) -> Floats:
    """Return the coefficients of a gap in the functions of its rows. Collective.

    The coefficients equal nodal values except on triangles of second order, with Bernstein
    functions.

    Args:
        comm: The ranks.
        hosts: The host facets on this rank.
        found: The covered parts of the facets.
        gap: The gap at the host surface's owned nodes (length), inf where it is unknown.
    """
    each, gdim = hosts["node"].shape[1], hosts["x"].shape[2]
    if not coupled(gdim, each):
        return gap
    hosts = hosts[found.covered > 0]
    corners = Exchange(comm, hosts["rank"].ravel())
    place = corners.forward(hosts["place"].ravel())
    on_facets = corners.back(gap[place]).reshape(hosts["node"].shape)
    inside = on_facets @ np.linalg.inv(own_basis(gdim, each))
    known = np.isfinite(inside)
    rows = corners.forward(np.where(known, inside, 0.0).ravel())
    counts = np.bincount(place, corners.forward(known.ravel()), len(gap))
    sums = np.bincount(place, rows, len(gap))
    return np.where(counts > 0, sums / np.maximum(counts, 1), gap)


def _met(x: Floats, normal: Floats, facet: Floats) -> tuple[Floats, Floats]:
    """Return where lines x + t·normal meet facets, one line for each facet.

    Returns:
        The share of the facet by which the line misses it, 0 if it meets it; and t. Both have shape
        (n,).
    """
    n, points, gdim = facet.shape
    at: Floats = np.full((n, gdim - 1), 1 / gdim)
    along: Floats = np.zeros(n)
    steps = 6  # Newton steps to the intersection of a normal with a curved facet
    for _ in range(steps if points > gdim else 1):
        functions = shape_functions(gdim, points, at)
        slopes = shape_functions(gdim, points, at, 1)
        tangents = np.einsum("rnp,npi->nir", slopes, facet)
        residual = np.einsum("np,npi->ni", functions, facet) - x - along[:, None] * normal
        matrix = np.concatenate([tangents, -normal[:, :, None]], axis=2)
        change = -np.linalg.solve(matrix, residual[:, :, None])[:, :, 0]
        at = at + change[:, :-1]
        if points > gdim:
            at = np.clip(at, -1.0, 2.0)  # a parabola extrapolates badly far outside the facet
        along = along + change[:, -1]
    least = np.minimum(at.min(axis=1), 1 - at.sum(axis=1))
    return np.maximum(-least, 0.0), along


def _sagitta(facets: Facets) -> Floats:
    """Return how far facets may deviate from the smooth surface, shape (n,)."""
    x, normal = facets["x"], facets["normal"]
    gdim = x.shape[2]
    longest = np.max([np.linalg.norm(x[:, i] - x[:, i - 1], axis=1) for i in range(gdim)], axis=0)
    flat = _facet_normals(x[:, :gdim])
    mean = flat * np.sign(np.einsum("ni,ni->n", flat, normal.mean(axis=1)))[:, None]
    turn = np.linalg.norm(normal - mean[:, None], axis=2).max(axis=1, initial=0)
    order = 3 if x.shape[1] > gdim else 1
    return np.asarray(longest * turn**order / 4, dtype=np.float64)


def _facet_normals(x: Floats) -> Floats:
    if x.shape[2] == 2:
        along = x[:, 1] - x[:, 0]
        normal: npt.NDArray[Any] = np.stack([along[:, 1], -along[:, 0]], axis=1)
    else:
        normal = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
    return np.asarray(normal / np.linalg.norm(normal, axis=1, keepdims=True))
