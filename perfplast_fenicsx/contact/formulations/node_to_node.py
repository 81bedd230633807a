"""Contact of surfaces whose nodes match: a row for each host and the guest opposite it."""

from dataclasses import dataclass

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.contact.declared.contact import Contact
from perfplast_fenicsx.contact.rows.constraints import Constraints, make_constraints
from perfplast_fenicsx.contact.surfaces.gap_function import MATCHING_TOLERANCE, normals_and_gaps
from perfplast_fenicsx.contact.surfaces.node_matching import Matching, match_nodes
from perfplast_fenicsx.contact.surfaces.surface_nodes import (
    can_host,
    check_outside,
    crowded,
    extent,
    surface_nodes,
)
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.parallel import send_rows


@dataclass(frozen=True)
class NodeToNode:
    """(u_a − u_b)·n ≤ g for each node a of the primary surface and b of the secondary opposite it.

    n is the mean of both surfaces' normals, so that it is the same seen from either. The host is a
    unless supports leave a no freedom along n, or rows of other contacts have taken more of it than
    of b's. Where three bodies meet along a curve two normals of a node may be one. Where supports
    leave b none either, there is no row.

    Attributes:
        contact: The two surfaces.
        place: Place in the input, for messages.
        number: Number of the contact.
        taken: See :func:`surface_nodes.surface_node_type`, of each local node; None for nothing.
    """

    contact: Contact
    place: str
    number: int
    taken: Floats | None = None

    def constraints(
        self, V: fem.FunctionSpace, tagged_mesh: TaggedMesh, fixed: npt.NDArray[np.bool_]
    ) -> Constraints:
        """See :meth:`constraints.Formulation.constraints`.

        Raises:
            InputError: Unknown names, surfaces whose nodes do not match or that do not face each
                other, overlap, or a negative gap.
        """
        comm, contact = V.mesh.comm, self.contact
        if contact.primary == contact.secondary:
            raise InputError(f"{self.place}: a surface cannot touch itself; name two surfaces.")
        primary, secondary = (
            surface_nodes(V, tagged_mesh, surface, fixed)
            for surface in (contact.primary, contact.secondary)
        )
        if self.taken is not None:
            for nodes in (primary, secondary):
                nodes["taken"] = self.taken[nodes["node"]]
        check_outside(comm, self.place, contact.primary, primary)
        check_outside(comm, self.place, contact.secondary, secondary)
        size = extent(comm, np.concatenate([primary["x"], secondary["x"]]))
        matching = match_nodes(comm, primary, secondary, MATCHING_TOLERANCE * size)
        normal, gap = normals_and_gaps(comm, self.place, contact, matching, size)
        pairs = _to_hosts(comm, matching, normal, gap, contact.rubs)
        every, coefficient = np.arange(len(pairs)), pairs["sign"][:, None] * pairs["normal"]
        host = pairs["host"] + V.dofmap.index_map.local_range[0]
        return make_constraints(
            V,
            pairs["host"],
            pairs["gap"],
            pairs["normal"],
            np.full(len(pairs), self.number, dtype=np.int32),
            [(every, host, coefficient), (every, pairs["guest"], -coefficient)],
            area=pairs["area"],
        )


def _pair_type(gdim: int) -> np.dtype:
    """Return the type of a pair's row.

    Its fields are the local block dof of the ``host`` on its rank, the global one of the ``guest``,
    the ``gap``, the unit ``normal`` out of the primary surface, the ``sign``: 1 if the host lies on
    the primary surface, −1 if on the secondary; and the ``area`` that either has, at least.
    """
    return np.dtype(
        [
            ("host", np.int32),
            ("guest", np.int64),
            ("gap", np.float64),
            ("normal", np.float64, gdim),
            ("sign", np.float64),
            ("area", np.float64),
        ]
    )


def _to_hosts(
    comm: MPI.Intracomm, matching: Matching, normal: Floats, gap: Floats, friction: bool
) -> npt.NDArray[np.void]:
    """Choose each pair's host, and send the pair there. Collective.

    Returns:
        The pairs hosted by this rank.
    """
    primary, secondary = matching.primary, matching.secondary
    on_primary = can_host(primary, normal)
    if friction:  # whose directions along the surface the host has to have
        freer = secondary["free"].sum(axis=1) > primary["free"].sum(axis=1)
        on_primary &= ~(freer & can_host(secondary, normal))
    else:
        more = 0.1  # of a square of a cosine: directions that are normal to each other may turn
        freer = crowded(primary, normal) > crowded(secondary, normal) + more
        on_primary &= ~(freer & can_host(secondary, normal))
    host, guest = (
        np.where(on_primary, *sides) for sides in ((primary, secondary), (secondary, primary))
    )
    pairs = np.empty(len(host), dtype=_pair_type(normal.shape[1]))
    pairs["host"] = host["node"]
    pairs["guest"] = guest["number"]
    pairs["gap"] = gap
    pairs["normal"] = normal
    pairs["sign"] = np.where(on_primary, 1.0, -1.0)
    pairs["area"] = np.minimum(primary["weight"], secondary["weight"])
    movable = on_primary | can_host(secondary, normal)
    return send_rows(comm, pairs[movable], host["rank"][movable])
