"""Form contact of surfaces with matching nodes: a row for each host and its opposite guest."""

from dataclasses import dataclass

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.contact.declared.contact import Contact
from perfplast_fenicsx.contact.rows.constraints import Constraints, make_constraints
from perfplast_fenicsx.contact.surfaces.node_matching import (
    MATCHING_TOLERANCE,
    Matching,
    match_nodes,
    normals_and_gaps,
)
from perfplast_fenicsx.contact.surfaces.surface_facets import (
    can_host,
    check_outside,
    crowded,
    extent,
    surface_nodes,
)
from perfplast_fenicsx.errors import InputError, raise_together
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.parallel import send_rows


@dataclass(frozen=True)
class NodeToNode:
    """The rows (u_a − u_b)·n ≤ g for each primary node a and its opposite secondary node b.

    The normal n is the mean of the normals of both surfaces, so only its sign depends on their
    order. The host is a, unless supports hold a along n. With friction, the host is b if supports
    leave more components of b free than of a. Without friction, rows of other contacts may already
    use directions of a or b, for example on a curve where three bodies meet. The host is b if the
    used directions of a are closer to n than those of b. If supports hold both a and b along n,
    there is no row.

    Attributes:
        contact: The two surfaces.
        place: Location in the case file, for messages.
        number: Number of the contact among the contacts and obstacles.
        taken: Directions at each local node that other rows already use, see
            :func:`surface_facets.surface_node_type`; None if there are none.
    """

    contact: Contact
    place: str
    number: int
    taken: Floats | None = None

    def constraints(
        self, V: fem.FunctionSpace, tagged_mesh: TaggedMesh, fixed: npt.NDArray[np.bool_]
    ) -> Constraints:
        """Return the rows; see :meth:`constraints.Formulation.constraints`.

        Raises:
            InputError: For an unknown name or a negative gap, or if the surfaces overlap, do not
                face each other, or have nodes that do not match.
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
        pairs = _to_hosts(comm, self.place, matching, normal, gap, contact.rubs)
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
    """Return the structured NumPy type of a pair of nodes.

    Its fields are the ``host`` as a local block dof on its rank, the ``guest`` as a global block
    dof, the ``gap`` and the unit ``normal`` out of the primary surface. Further fields are the
    ``sign`` (1 if the host lies on the primary surface, −1 if it lies on the secondary surface) and
    the smaller ``area`` of the two nodes.
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
    comm: MPI.Intracomm,
    place: str,
    matching: Matching,
    normal: Floats,
    gap: Floats,
    friction: bool,
) -> npt.NDArray[np.void]:
    """Choose the host of each pair, and return the pairs on the ranks of their hosts. Collective.

    Returns:
        The pairs whose hosts this rank owns.

    Raises:
        InputError: If a node of a moving rigid body is opposite a node that supports hold.
    """
    primary, secondary = matching.primary, matching.secondary
    on_primary = can_host(primary, normal)
    if friction:  # the host must be free along its directions in the surface
        freer = secondary["free"].sum(axis=1) > primary["free"].sum(axis=1)
        on_primary &= ~(freer & can_host(secondary, normal))
    else:
        more = 0.1  # squared cosine that perpendicular directions may have
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
    follows = [np.trace(side["taken"], axis1=1, axis2=2) > 0 for side in (primary, secondary)]
    held = [~side["free"].any(axis=1) for side in (primary, secondary)]
    lost = ~movable & ((follows[0] & held[0]) | (follows[1] & held[1]))
    raise_together(
        comm,
        f"{place}: the contact surface touches a body with law = 'rigid' at nodes that supports or "
        "ties hold along the normal; remove these nodes from the support, from the tie or from "
        "the contact surface."
        if lost.any()
        else None,
    )
    return send_rows(comm, pairs[movable], host["rank"][movable])
