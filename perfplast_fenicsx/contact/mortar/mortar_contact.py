"""Form contact between surfaces whose nodes need not match (dual mortar method)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats, PairFlags
from perfplast_fenicsx.contact.declared.contact import Contact
from perfplast_fenicsx.contact.mortar.facet_overlap import rendezvous
from perfplast_fenicsx.contact.mortar.mortar_rows import (
    Integrals,
    MortarRows,
    coupled,
    integrate,
    mortar_rows,
    own_basis,
    turning,
)
from perfplast_fenicsx.contact.rows.constraints import Constraints, make_constraints
from perfplast_fenicsx.contact.surfaces.node_matching import OVERLAP, given_gap, without_overlap
from perfplast_fenicsx.contact.surfaces.surface_facets import (
    Facets,
    SurfaceNodes,
    can_host,
    check_outside,
    extent,
    nodes_and_facets,
    pieces_of,
    shape_functions,
)
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.mesh.kinematics import Kinematics
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.parallel import Exchange, send_rows


@dataclass(frozen=True)
class Distances:
    """Distances from the owned nodes of this rank to the other surface.

    Attributes:
        along: Distance along the normal of each node, negative for a node inside the other body,
            inf if nothing is opposite, shape (num_nodes,).
        slack: Geometric error of the facets (length), shape (num_nodes,). Because facets differ
            from the curved surfaces, two curved surfaces in contact may appear apart or overlapping
            by this length.
    """

    along: Floats
    slack: Floats


def distances(
    comm: MPI.Intracomm, hosts: Facets, guests: Facets, found: Integrals, count: int
) -> Distances:
    """Return the distances from the nodes of host facets to the guest facets that they overlap.

    Collective.

    The distance refers to the guest facet that the normal meets. If the normal meets no facet, as
    at the border of the covered part, the function extends the nearest facet.

    Args:
        comm: Communicator of the ranks.
        hosts: The host facets on this rank.
        guests: The guest facets.
        found: Integrals over the overlaps of both.
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
    sideways = 1e-9  # a normal that misses a facet by less than this fraction of its size meets it
    order = np.lexsort([np.abs(rows["along"]), np.maximum(rows["aside"], sideways), rows["place"]])
    rows = rows[order]
    place, first = np.unique(rows["place"], return_index=True)
    result = Distances(np.full(count, np.inf), np.zeros(count))
    result.along[place] = rows["along"][first]
    np.maximum.at(result.slack, rows["place"], rows["slack"])
    return result


def in_basis(comm: MPI.Intracomm, hosts: Facets, found: Integrals, gap: Floats) -> Floats:
    """Return the coefficients of a gap with respect to the basis functions of its rows. Collective.

    The coefficients equal the nodal values, except on triangles of second order, whose basis
    functions are Bernstein polynomials.

    Args:
        comm: Communicator of the ranks.
        hosts: The host facets on this rank.
        found: Integrals over the overlaps, with the covered length or area of each facet.
        gap: The gap at the owned nodes of the host surface (length), inf where it is unknown.
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
    """Return where lines x + t·normal meet facets, for one line per facet.

    Returns:
        The distance by which the line misses the facet, relative to the facet, 0 if the line meets
        the facet; and t. Both have shape (n,).
    """
    n, points, gdim = facet.shape
    at: Floats = np.full((n, gdim - 1), 1 / gdim)
    along: Floats = np.zeros(n)
    steps = 6  # Newton iterations for the intersection of a normal with a curved facet
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
    """Return how far the facets may deviate from the smooth surface (length), shape (n,)."""
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


@dataclass(frozen=True)
class Facing:
    """Host facets, each on one rank, and the guest facets that overlap them, on the same rank.

    Attributes:
        hosts: All host facets.
        guests: Overlapping facets of the other surface; some are listed more than once.
        found: Integrals over the overlaps.
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
    """Return the facets of two surfaces that are opposite each other. Collective.

    The search doubles its reach until it finds an overlap. With ``onward``, the search then
    continues for host facets without an overlap, but only in front of the host facets. A guest
    facet that lies deeper inside the host's body than the first successful reach does not count as
    an overlap of bodies. For partly covered facets the reach grows by the distance by which
    opposite surfaces can diverge along these facets.

    Args:
        comm: Communicator of the ranks.
        hosts: Facets on this rank of the surface with the multipliers.
        guests: Facets on this rank of the other surface.
        size: Size of both surfaces (length).
        around: See :func:`mortar_rows.integrate`.
        onward: Whether each host facet continues the search up to ``size``.
    """
    parts: list[Facing] = []
    # Initial search distance as a fraction of the size of both surfaces.
    first_reach = 0.1
    reach, behind = first_reach * size, np.inf
    lean = 3 * sum(comm.allreduce(_radius(facets), MPI.MAX) for facets in (hosts, guests))
    along = comm.allreduce(bool(turning(hosts).any()), MPI.LOR)
    whole = 1 - 1e-9  # a facet with this covered fraction counts as fully covered
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
    """Return the largest distance on this rank between a facet's points and its centre."""
    apart = facets["x"] - facets["x"].mean(axis=1, keepdims=True)
    return float(np.linalg.norm(apart, axis=2).max(initial=0))


def _of(found: Integrals, some: PairFlags) -> Integrals:
    """Return the integrals of the chosen host facets, with new facet numbers."""
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


@dataclass(frozen=True)
class Surface:
    """A named surface: its nodes that this rank owns, and its facets on this rank."""

    name: str
    nodes: SurfaceNodes
    facets: Facets

    def measure(self, comm: MPI.Intracomm) -> tuple[float, float]:
        """Return the length or area of the surface, and its mean per facet. Collective."""
        local = np.array([pieces_of(self.facets).measure.sum(), len(self.facets)])
        area, count = comm.allreduce(local)
        return float(area), float(area / max(count, 1))


@dataclass(frozen=True)
class Side:
    """The chosen host surface of a contact, with its rows and its distances from the guest.

    Attributes:
        host: The host surface.
        guest: The other surface.
        facing: Opposite facets of both surfaces.
        rows: The sets of rows, one set for each array of flags that ``Able`` returns.
        distances: Distances from the nodes of the host surface to the guest surface.
        covered: Covered fraction of the host surface and of the guest surface.
    """

    host: Surface
    guest: Surface
    facing: Facing
    rows: Sequence[MortarRows]
    distances: Distances
    covered: tuple[float, float]

    @property
    def lost(self) -> int:
        """Return the number of nodes, in all sets, that can neither host a row nor be replaced."""
        return sum(rows.lost for rows in self.rows)


Able = Callable[[SurfaceNodes], Sequence[PairFlags]]
"""Function that returns which nodes supports allow to host, as one array of flags for each set of
rows."""


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
        comm: Communicator of the ranks.
        place: Location of the contact in the case file, for messages.
        surfaces: The primary and the secondary surface.
        hosts: "primary" or "secondary" if the user chooses; else None.
        able: Function that returns which nodes may host.
        kinematics: Kinematics of the mesh.
        onward: See :func:`facing_facets`.

    Raises:
        InputError: If the surfaces are nowhere opposite each other, or if supports or ties hold
            host nodes.
    """
    measures = [surface.measure(comm) for surface in surfaces]
    for surface in surfaces:
        check_outside(comm, place, surface.name, surface.nodes)
    # Facets below this fraction of the mean size on the other surface count as smaller.
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
    whole = 0.99  # a surface with this covered fraction counts as covered
    better_covered = chosen.covered[0] < whole <= chosen.covered[1]
    if hosts is None and (better_covered or chosen.lost):
        other = side(1 - first)
        if other.covered[0] and (better_covered or other.lost < chosen.lost):
            chosen = other
    if chosen.lost:
        raise InputError(
            f"{place}: supports or ties hold {chosen.lost} nodes of '{chosen.host.name}', and no "
            "neighbouring node can take over their contact forces; remove the held nodes from "
            "this surface, or set hosts ('primary' or 'secondary') to the side of "
            f"'{chosen.guest.name}'."
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
    """Return the rows for a chosen host surface. Collective."""
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


@dataclass(frozen=True)
class Mortar:
    """The rows (1/d_j) ∫φ_j (u_a − u_b)·n ≤ g_j, with a dual function φ_j for each host node j.

    The hosts are the nodes of one surface: the surface that the other surface covers, or the
    surface with smaller facets if the surfaces cover each other or neither covers the other. A dual
    function belongs to a smooth face of the host surface, and n is the normal of this face at the
    node. On triangles of second order, φ_j belongs to a Bernstein coefficient instead of a node,
    and n is the normal at each point. The row is then the coefficient of the normal jump, and g_j
    is the coefficient of the gap at the nodes.

    Attributes:
        contact: The two surfaces.
        place: Location in the case file, for messages.
        number: Number of the contact among the contacts and obstacles.
    """

    contact: Contact
    place: str
    number: int

    def constraints(
        self, V: fem.FunctionSpace, tagged_mesh: TaggedMesh, fixed: npt.NDArray[np.bool_]
    ) -> Constraints:
        """Return the rows; see :meth:`constraints.Formulation.constraints`.

        Raises:
            InputError: For unknown names or a negative gap, for surfaces that overlap or are
                nowhere opposite each other, or if supports hold hosts.
        """
        contact = self.contact
        if contact.primary == contact.secondary:
            raise InputError(f"{self.place}: a surface cannot touch itself; name two surfaces.")
        surfaces = [
            Surface(name, *nodes_and_facets(V, tagged_mesh, name, fixed))
            for name in (contact.primary, contact.secondary)
        ]
        comm = V.mesh.comm
        held = _held_everywhere(comm, surfaces)

        def able(nodes: SurfaceNodes) -> list[PairFlags]:
            along = can_host(nodes, nodes["normal"])
            return [along & (nodes["free"] | held).all(axis=1) if contact.rubs else along]

        chosen = choose_side(
            comm,
            self.place,
            surfaces,
            contact.hosts,
            able,
            tagged_mesh.kinematics,
            onward=contact.gap is None,
        )
        primary = chosen.host is surfaces[0]
        gap = self._gap(V, chosen, primary)
        (rows,) = chosen.rows
        nodes = chosen.host.nodes[rows.place]
        coefficient = rows.coefficients(nodes["normal"])
        normal = np.zeros_like(nodes["normal"])
        np.add.at(normal, rows.row[rows.own], coefficient[rows.own])
        sides = (rows.own, ~rows.own)
        shares = rows.weight[rows.own], -rows.weight[~rows.own]
        found = make_constraints(
            V,
            nodes["node"],
            gap,
            normal if primary else -normal,
            np.full(len(nodes), self.number, dtype=np.int32),
            [
                (rows.row[side], rows.node[side], coefficient[side], share)
                for side, share in zip(sides, shares, strict=True)
            ],
            area=rows.d,
        )
        return replace(found, in_mean=True, remarks=(self._remark(V, chosen),))

    def _remark(self, V: fem.FunctionSpace, chosen: Side) -> str:
        """Return a remark on the host surface and on the error of straight facets. Collective."""
        comm, gdim = V.mesh.comm, V.mesh.geometry.dim
        count = comm.allreduce(len(chosen.rows[0].place))
        missed = comm.allreduce(float(chosen.distances.slack.max(initial=0)), MPI.MAX)
        size = extent(comm, chosen.host.nodes["x"])
        straight = ""
        if chosen.host.facets["x"].shape[1] == gdim and missed > OVERLAP * size:
            straight = (
                "; straight facets there deviate from the curved surfaces by up to "
                f"{missed:.2g}: expect pressure errors of a few per cent where facets are "
                "coarse, and a tenth of these errors on a mesh of second order"
            )
        own, others = (f"{min(share, 1):.0%}" for share in chosen.covered)
        return (
            f"{self.place}: mortar contact, hosted by {count} nodes of '{chosen.host.name}'; "
            f"'{chosen.guest.name}' covers {own} of this surface, and this surface covers "
            f"{others} of '{chosen.guest.name}'{straight}."
        )

    def _gap(self, V: fem.FunctionSpace, chosen: Side, primary: bool) -> Floats:
        """Return the gap of each row (length). Collective."""
        comm, (rows,) = V.mesh.comm, chosen.rows
        at_nodes = self._gap_at_nodes(V, chosen, primary)
        gap = in_basis(comm, chosen.facing.hosts, chosen.facing.found, at_nodes)[rows.place]
        # Coefficients of a gap that opens from a point may be negative next to the point.
        return gap if self.contact.interference else np.maximum(gap, 0.0)

    def _gap_at_nodes(self, V: fem.FunctionSpace, chosen: Side, primary: bool) -> Floats:
        """Return the gap at each node of the host surface (length), inf where nothing is opposite.

        Collective.
        """
        comm, gdim = V.mesh.comm, V.mesh.geometry.dim
        (rows,) = chosen.rows
        nodes, along, slack = chosen.host.nodes, chosen.distances.along, chosen.distances.slack
        size = extent(comm, nodes["x"][rows.place])
        if self.contact.gap is not None:
            gap: Floats = np.full(len(nodes), np.inf)
            seen = np.isfinite(along)
            x = nodes["x"][seen]
            if not primary:
                x[:, :gdim] += along[seen, None] * nodes["normal"][seen]
            gap[seen] = given_gap(comm, self.place, self.contact, x, size)
            return gap
        gap = np.asarray(np.where(np.abs(along) > slack, along, 0.0), dtype=np.float64)
        if self.contact.interference:
            self._check_seen(comm, along[rows.place], slack[rows.place], size)
            return gap
        without_overlap(comm, self.place, gap[rows.place], size)
        return np.where(gap > OVERLAP * size, gap, 0.0)

    def _check_seen(self, comm: MPI.Intracomm, along: Floats, slack: Floats, size: float) -> None:
        """Refuse straight facets of curved surfaces if they hide an overlap. Collective."""
        hidden = (np.abs(along) > OVERLAP * size) & (np.abs(along) <= slack)
        if comm.allreduce(int(hidden.sum())):
            least = comm.allreduce(float(slack[hidden].max(initial=0)), MPI.MAX)
            raise InputError(
                f"{self.place}: the straight facets of curved surfaces cannot resolve an overlap "
                f"below {least:.3g}; give the initial gap as gap = ..., or give a mesh of second "
                "order."
            )


def _held_everywhere(comm: MPI.Intracomm, surfaces: Sequence[Surface]) -> npt.NDArray[np.bool_]:
    """Return which components supports hold at all nodes, shape (gdim,). Collective."""
    free = np.concatenate([surface.nodes["free"] for surface in surfaces]).any(axis=0)
    comm.Allreduce(MPI.IN_PLACE, free, MPI.LOR)
    held: npt.NDArray[np.bool_] = ~free
    return held
