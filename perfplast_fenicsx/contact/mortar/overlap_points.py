"""Compute points at which overlaps of curved facets are integrated.

Overlaps are found between straight pieces. Their points are mapped to the host's facet by reference
coordinates, and along its normal to the guest's facet. So areas, places and normals are those of
the facets of second order instead of the pieces (T. Dickopf and R. Krause, Int. J. Numer. Meth.
Engng 77, 2009, doi 10.1002/nme.2464).
"""

import functools
from dataclasses import dataclass

import basix
import numpy as np

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.contact.mortar.clipping import Overlaps
from perfplast_fenicsx.contact.surfaces.surface_facets import Facets, Pieces, shape_functions


@dataclass(frozen=True)
class OverlapPoints:
    """Quadrature points of n overlaps, with q points each.

    Attributes:
        host: Number of the host facet, shape (n,).
        guest: Number of the guest facet, shape (n,).
        own: The host's functions N at the points, shape (n, q, nodes of a facet).
        other: The guest's functions, same shape.
        x: Coordinates on the host, shape (n, q, gdim).
        normal: The host's normal, interpolated between its nodes, same shape.
        weight: Quadrature weight as length or area of the host facet, shape (n, q).
    """

    host: Longs
    guest: Longs
    own: Floats
    other: Floats
    x: Floats
    normal: Floats
    weight: Floats


def overlap_points(
    hosts: Facets,
    guests: Facets,
    pieces: tuple[Pieces, Pieces],
    numbers: tuple[Longs, Longs],
    found: Overlaps,
    degree: int,
) -> OverlapPoints:
    """Return the quadrature points of overlaps of pieces.

    Args:
        hosts: Facets that carry multipliers.
        guests: Facets of the other surface.
        pieces: Pieces of both.
        numbers: Numbers of the host's and the guest's piece of each overlap.
        found: The overlaps.
        degree: Degree of polynomials that are integrated exactly on straight facets.
    """
    (host, guest), (h, g) = pieces, numbers
    e, f = host.facet[h], guest.facet[g]
    points, weights = rule(host.x.shape[1], degree)
    at_host = points @ (found.host @ host.at[h])
    at_guest = points @ (found.guest @ guest.at[g])
    weight = weights * (found.share * host.measure[h])[:, None]
    bent = np.flatnonzero(host.curved[h])
    share = (found.share[bent] * host.part[h[bent]])[:, None]
    weight[bent] = weights * share * area_elements(hosts["x"][e[bent]], at_host[bent])
    (_, each), (_, count, gdim) = hosts["node"].shape, hosts["x"].shape
    own = shape_functions(gdim, each, at_host)
    x = (own if each == count else shape_functions(gdim, count, at_host)) @ hosts["x"][e]
    normal = own @ hosts["normal"][e]
    moved = np.flatnonzero(host.curved[h] | guest.curved[g])
    facet = guests["x"][f[moved]]
    at_guest[moved] = _carried(x[moved], normal[moved], facet, at_guest[moved])
    return OverlapPoints(e, f, own, shape_functions(gdim, each, at_guest), x, normal, weight)


def rule(gdim: int, degree: int) -> tuple[Floats, Floats]:
    """Return barycentric points and weights; the weights sum to 1."""
    kind = basix.CellType.interval if gdim == 2 else basix.CellType.triangle
    points, weights = (np.asarray(one) for one in basix.make_quadrature(kind, degree))
    first = 1 - points.sum(axis=1, keepdims=True)
    return np.concatenate([first, points], axis=1), weights / weights.sum()


def area_elements(x: Floats, at: Floats) -> Floats:
    """Return the ratio of length or area to that of the reference facet, shape (n, q)."""
    tangents = _tangents(x, at)
    if len(tangents) == 1:
        return np.asarray(np.linalg.norm(tangents[0], axis=2))
    return np.asarray(np.linalg.norm(np.cross(tangents[0], tangents[1]), axis=2))


def _tangents(x: Floats, at: Floats) -> list[Floats]:
    _, count, gdim = x.shape
    return [slope @ x for slope in shape_functions(gdim, count, at, 1)]


def _carried(x: Floats, normal: Floats, facet: Floats, at: Floats) -> Floats:
    """Return where lines along normals meet facets, by one Newton step from a near point.

    Args:
        x: Points of the lines, shape (n, q, gdim).
        normal: Their directions, same shape.
        facet: Facet of each line, shape (n, points of a facet, gdim).
        at: Reference coordinates nearby, shape (n, q, gdim − 1).
    """
    _, count, gdim = facet.shape
    apart = x - shape_functions(gdim, count, at) @ facet
    tangents = _tangents(facet, at)
    if len(tangents) == 1:
        across = [np.stack([normal[..., 1], -normal[..., 0]], axis=-1)]
    else:
        pairs = ((tangents[1], normal), (normal, tangents[0]))
        across = [np.asarray(np.cross(a, b), dtype=np.float64) for a, b in pairs]
    whole = np.einsum("nqi,nqi->nq", tangents[0], across[0])
    step = np.stack([np.einsum("nqi,nqi->nq", apart, one) / whole for one in across], axis=2)
    # If the step would move a point farther than this in the guest's reference facet, the point
    # stays in the piece: the gap is too wide or the facet too oblique for one step.
    astray = 0.25
    near = functools.reduce(np.maximum, np.abs(step).transpose(2, 0, 1)) <= astray
    return np.asarray(np.where(near[:, :, None], at + step, at))
