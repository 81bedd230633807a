"""Find facets of two surfaces that are opposite each other, at growing distances."""

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
    """Host facets, each on one rank, and the guest facets on that rank that they overlap.

    Attributes:
        hosts: All host facets.
        guests: Overlapping facets of the other surface; some occur more than once.
        found: Integrals over their overlaps.
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
    """Return the facets that are opposite each other. Collective.

    The search doubles the reach until it finds an overlap. With ``onward``, host facets without an
    overlap then continue the search. They search only in front. A guest deeper inside than the
    first successful reach is not an overlap of bodies. Partly covered facets search farther by the
    distance by which facing surfaces can diverge along them.

    Args:
        comm: The ranks.
        hosts: This rank's facets of the surface that carries the multipliers.
        guests: This rank's facets of the other surface.
        size: Size of both surfaces (length).
        around: See :func:`mortar_integrals.integrate`.
        onward: Whether each host facet searches up to this size.
    """
    parts: list[Facing] = []
    # Initial search distance as a share of the size of both surfaces.
    first_reach = 0.1
    reach, behind = first_reach * size, np.inf
    lean = 3 * sum(comm.allreduce(_radius(facets), MPI.MAX) for facets in (hosts, guests))
    along = comm.allreduce(bool(turning(hosts).any()), MPI.LOR)
    whole = 1 - 1e-9  # a facet with this covered share counts as fully covered
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
    """Return the largest distance of a point of this rank's facets from its facet's centre."""
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
