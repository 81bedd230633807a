"""Choose the surface whose nodes carry the multipliers of mortar contact."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from mpi4py import MPI

import numpy as np

from perfplast_fenicsx.arrays import PairFlags
from perfplast_fenicsx.contact.mortar.facing_facets import Facing, facing_facets
from perfplast_fenicsx.contact.mortar.mortar_gap import Distances, distances
from perfplast_fenicsx.contact.mortar.mortar_rows import MortarRows, mortar_rows
from perfplast_fenicsx.contact.surfaces.surface_facets import Facets, pieces_of
from perfplast_fenicsx.contact.surfaces.surface_nodes import SurfaceNodes, check_outside, extent
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.mesh.kinematics import Kinematics


@dataclass(frozen=True)
class Surface:
    """A named surface: its owned nodes and the facets of this rank."""

    name: str
    nodes: SurfaceNodes
    facets: Facets

    def measure(self, comm: MPI.Intracomm) -> tuple[float, float]:
        """Return the length or area of the surface, and the mean of its facets. Collective."""
        local = np.array([pieces_of(self.facets).measure.sum(), len(self.facets)])
        area, count = comm.allreduce(local)
        return float(area), float(area / max(count, 1))


@dataclass(frozen=True)
class Side:
    """The result of choosing the host surface.

    Attributes:
        host: The host surface.
        guest: The other surface.
        facing: Facing facets.
        rows: The rows, one set for each way in which nodes may host.
        distances: Distances of the host's nodes to the guest.
        covered: Covered shares of both surfaces, the host's first.
    """

    host: Surface
    guest: Surface
    facing: Facing
    rows: Sequence[MortarRows]
    distances: Distances
    covered: tuple[float, float]

    @property
    def lost(self) -> int:
        """Return the number of nodes that can neither host nor be replaced, in all ways."""
        return sum(rows.lost for rows in self.rows)


Able = Callable[[SurfaceNodes], Sequence[PairFlags]]
"""A function that returns which nodes supports let host, in several ways if several sets of rows
are needed."""


def choose_side(
    comm: MPI.Intracomm,
    place: str,
    surfaces: Sequence[Surface],
    hosts: str | None,
    able: Able,
    kinematics: Kinematics,
    onward: bool,
) -> Side:
    """Return the host surface and its rows. Collective.

    Args:
        comm: The ranks.
        place: Place of the contact, which messages name.
        surfaces: The primary and the secondary surface.
        hosts: "primary" or "secondary" if the user gives it.
        able: Function that returns which nodes may host.
        kinematics: Kinematics of the mesh.
        onward: See :func:`facing_facets.facing_facets`.

    Raises:
        InputError: For surfaces that are nowhere opposite each other, and for hosts that supports
            hold.
    """
    measures = [surface.measure(comm) for surface in surfaces]
    for surface in surfaces:
        check_outside(comm, place, surface.name, surface.nodes)
    # Facets below this share of the other surface's mean size count as smaller.
    finer_by = 0.99
    finer = measures[1][1] < finer_by * measures[0][1]
    first = int(finer) if hosts is None else ("primary", "secondary").index(hosts)

    def side(host: int) -> Side:
        areas = (measures[host][0], measures[1 - host][0])
        return _side(comm, surfaces[host], surfaces[1 - host], areas, able, kinematics, onward)

    chosen = side(first)
    if not chosen.covered[0]:
        raise InputError(
            f"{place}: the surfaces are nowhere opposite each other; name two surfaces that face"
            " each other and whose projections along their normals overlap."
        )
    whole = 0.99  # a surface counts as covered from this share on
    better_covered = chosen.covered[0] < whole <= chosen.covered[1]
    if hosts is None and (better_covered or chosen.lost):
        other = side(1 - first)
        if other.covered[0] and (better_covered or other.lost < chosen.lost):
            chosen = other
    if chosen.lost:
        raise InputError(
            f"{place}: supports or ties hold {chosen.lost} nodes of '{chosen.host.name}', "
            "and no neighbouring node can carry the forces there; remove held nodes from "
            f"this surface, or let '{chosen.guest.name}' host."
        )
    return chosen


def _side(
    comm: MPI.Intracomm,
    host: Surface,
    guest: Surface,
    areas: tuple[float, float],
    able: Able,
    kinematics: Kinematics,
    onward: bool,
) -> Side:
    """Return the rows for a given host surface. Collective."""
    corners = np.concatenate([surface.nodes["x"] for surface in (host, guest)])
    facing = facing_facets(
        comm, host.facets, guest.facets, extent(comm, corners), kinematics.around, onward
    )
    here, there, found = facing.hosts, facing.guests, facing.found
    covered = comm.allreduce(np.array([found.covered.sum(), found.on_guest.sum()]))
    return Side(
        host,
        guest,
        facing,
        [mortar_rows(comm, here, there, found, flags) for flags in able(host.nodes)],
        distances(comm, here, there, found, len(host.nodes)),
        (float(covered[0] / areas[0]), float(covered[1] / areas[1])),
    )
