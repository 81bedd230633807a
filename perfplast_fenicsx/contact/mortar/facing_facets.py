"""Facets of two surfaces that lie opposite each other, looked for in ever larger distances."""

from collections.abc import Callable
from dataclasses import dataclass

from mpi4py import MPI

import numpy as np

from perfplast_fenicsx.arrays import Floats, PairFlags
from perfplast_fenicsx.contact.mortar.dual_functions import turning
from perfplast_fenicsx.contact.mortar.facet_pairing import rendezvous
from perfplast_fenicsx.contact.mortar.mortar_integrals import Integrals, integrate
from perfplast_fenicsx.contact.surfaces.surface_facets import Facets


@dataclass(frozen=True)
class Facing:
    """Host facets, each on one rank, and the guest facets there that they overlap.

    Attributes:
        hosts: All host facets.
        guests: Those of the other surface that were met; some more than once.
        found: Their integrals.
    """

    hosts: Facets
    guests: Facets
    found: Integrals


def facing_facets(
    comm: MPI.Intracomm,
    hosts: Facets,
    guests: Facets,
    size: float,
    around: Callable[[Floats], Floats],
    onward: bool,
) -> Facing:
    """Look for what lies opposite. Collective.

    The reach is doubled until anything is found and, if that is asked for, host facets that have
    found nothing go on searching. In front of them alone: what lies deeper inside them than the
    first reach that found anything is not an overlap of bodies. Those that are covered in part look
    as much farther as surfaces that face each other can lean apart along them.

    Args:
        comm: The ranks.
        hosts: This rank's facets of the surface that carries the multipliers.
        guests: The same of the other surface.
        size: Size of both surfaces (length).
        around: See :func:`mortar_integrals.integrate`.
        onward: Whether each host facet searches up to this size.
    """
    parts: list[Facing] = []
    # Facets are first looked for in distances of this share of the size of both surfaces.
    first_reach = 0.1
    reach, behind = first_reach * size, np.inf
    lean = 3 * sum(comm.allreduce(_radius(facets), MPI.MAX) for facets in (hosts, guests))
    along = comm.allreduce(bool(turning(hosts).any()), MPI.LOR)
    whole = 1 - 1e-9  # a facet of which this share is covered is covered in whole
    while True:
        here, there = rendezvous(comm, hosts, guests, reach + lean)
        found = integrate(here, there, reach, around, min(reach, behind), along)
        covered = found.covered > 0
        partly = covered & onward & (found.covered < whole * found.whole)
        if partly.any():
            more = integrate(here[partly], there, reach + lean, around, min(reach, behind), along)
            parts.append(Facing(here[partly], there, more))
        some, alone = comm.allreduce(np.array([covered.sum(), (~covered).sum()]))
        last = reach > size or not alone or (not onward and some)
        done = ~partly if last else covered & ~partly
        parts.append(Facing(here[done], there, _of(found, done)))
        if last:
            return _joined(parts)
        if some:
            hosts, behind = here[~covered], min(reach, behind)
        reach *= 2


def _radius(facets: Facets) -> float:
    """Largest distance of a point of this rank's facets from its facet's centre."""
    apart = facets["x"] - facets["x"].mean(axis=1, keepdims=True)
    return float(np.linalg.norm(apart, axis=2).max(initial=0))


def _of(found: Integrals, some: PairFlags) -> Integrals:
    """Return the integrals of some host facets, renumbered."""
    number, kept = np.cumsum(some) - 1, some[found.host]
    return Integrals(
        number[found.host[kept]],
        found.guest[kept],
        found.M[kept],
        None if found.along is None else found.along[kept],
        found.d[some],
        found.full[some],
        found.covered[some],
        found.whole[some],
        found.on_guest[some],
    )


def _joined(parts: list[Facing]) -> Facing:
    found = [part.found for part in parts]
    along = [one.along for one in found if one.along is not None]
    hosts = np.cumsum([0, *(len(part.hosts) for part in parts)])
    guests = np.cumsum([0, *(len(part.guests) for part in parts)])
    return Facing(
        np.concatenate([part.hosts for part in parts]),
        np.concatenate([part.guests for part in parts]),
        Integrals(
            np.concatenate([one.host + k for one, k in zip(found, hosts, strict=False)]),
            np.concatenate([one.guest + k for one, k in zip(found, guests, strict=False)]),
            np.concatenate([one.M for one in found]),
            np.concatenate(along) if len(along) == len(found) else None,
            np.concatenate([one.d for one in found]),
            np.concatenate([one.full for one in found]),
            np.concatenate([one.covered for one in found]),
            np.concatenate([one.whole for one in found]),
            np.concatenate([one.on_guest for one in found]),
        ),
    )
