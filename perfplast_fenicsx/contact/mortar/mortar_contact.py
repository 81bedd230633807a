"""Form contact of surfaces whose nodes need not match: dual mortar."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats, PairFlags
from perfplast_fenicsx.contact.declared.contact import Contact
from perfplast_fenicsx.contact.mortar.mortar_gap import in_basis
from perfplast_fenicsx.contact.mortar.mortar_sides import Side, Surface, choose_side
from perfplast_fenicsx.contact.rows.constraints import Constraints, make_constraints
from perfplast_fenicsx.contact.surfaces.gap_function import OVERLAP, given_gap, without_overlap
from perfplast_fenicsx.contact.surfaces.surface_facets import nodes_and_facets
from perfplast_fenicsx.contact.surfaces.surface_nodes import SurfaceNodes, can_host, extent
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh


@dataclass(frozen=True)
class Mortar:
    """The rows (1/d_j) ∫φ_j (u_a − u_b)·n ≤ g_j, with a dual function φ_j for each host node j.

    The hosts are the nodes of one surface: the one that the other covers, or the one with smaller
    facets if both or neither are covered. A dual function belongs to a smooth face of the host
    surface. The normal n is that of the face at the node. On triangles of second order, φ_j belongs
    to a Bernstein coefficient instead of a node, and n is the normal at each point. The row is then
    the coefficient of the normal jump, and the gap is the coefficient of the gap at nodes.

    Attributes:
        contact: The two surfaces.
        place: Place in the input, which messages name.
        number: Number of the contact.
    """

    contact: Contact
    place: str
    number: int

    def constraints(
        self, V: fem.FunctionSpace, tagged_mesh: TaggedMesh, fixed: npt.NDArray[np.bool_]
    ) -> Constraints:
        """Return the rows, see :meth:`constraints.Formulation.constraints`.

        Raises:
            InputError: For unknown names, surfaces that are nowhere opposite each other or that
                overlap, a negative gap, or hosts that supports hold.
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
        """Return a remark on the chosen side, and on the error of straight facets. Collective."""
        comm, gdim = V.mesh.comm, V.mesh.geometry.dim
        count = comm.allreduce(len(chosen.rows[0].place))
        missed = comm.allreduce(float(chosen.distances.slack.max(initial=0)), MPI.MAX)
        size = extent(comm, chosen.host.nodes["x"])
        straight = ""
        if chosen.host.facets["x"].shape[1] == gdim and missed > OVERLAP * size:
            straight = (
                "; straight facets deviate there from the curved surfaces by up to "
                f"{missed:.2g}: expect errors of some per cent in pressures where facets "
                "are coarse, and a tenth of them on a mesh of second order"
            )
        shares = " and ".join(f"{min(share, 1):.0%}" for share in chosen.covered)
        return (
            f"{self.place}: mortar contact, hosted by {count} nodes of "
            f"'{chosen.host.name}'; of it and of '{chosen.guest.name}' {shares} are "
            f"covered by the other{straight}."
        )

    def _gap(self, V: fem.FunctionSpace, chosen: Side, primary: bool) -> Floats:
        """Return the gap of each row (length). Collective."""
        comm, (rows,) = V.mesh.comm, chosen.rows
        at_nodes = self._gap_at_nodes(V, chosen, primary)
        gap = in_basis(comm, chosen.facing.hosts, chosen.facing.found, at_nodes)[rows.place]
        # coefficients of a gap that opens from a point may be negative beside the point
        return gap if self.contact.interference else np.maximum(gap, 0.0)

    def _gap_at_nodes(self, V: fem.FunctionSpace, chosen: Side, primary: bool) -> Floats:
        """Return the gap at each of the host's nodes (length), inf where nothing is opposite.

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
        """Refuse straight facets of curved surfaces that hide an overlap. Collective."""
        hidden = (np.abs(along) > OVERLAP * size) & (np.abs(along) <= slack)
        if comm.allreduce(int(hidden.sum())):
            least = comm.allreduce(float(slack[hidden].max(initial=0)), MPI.MAX)
            raise InputError(
                f"{self.place}: straight facets of curved surfaces hide an overlap below"
                f" {least:.3g}; give gap = ..., or a mesh of second order."
            )


def _held_everywhere(comm: MPI.Intracomm, surfaces: Sequence[Surface]) -> npt.NDArray[np.bool_]:
    """Return which components supports hold at every node, shape (gdim,). Collective."""
    free = np.concatenate([surface.nodes["free"] for surface in surfaces]).any(axis=0)
    comm.Allreduce(MPI.IN_PLACE, free, MPI.LOR)
    held: npt.NDArray[np.bool_] = ~free
    return held
