"""Form ties as rows B u = 0: the mortar rows for each displacement component."""

from collections.abc import Sequence
from dataclasses import replace

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from perfplast_fenicsx.arrays import PairFlags
from perfplast_fenicsx.contact.declared.contact import Tie
from perfplast_fenicsx.contact.mortar.mortar_contact import Surface, choose_side
from perfplast_fenicsx.contact.rows.constraints import Constraints, joined, make_constraints
from perfplast_fenicsx.contact.surfaces.surface_facets import SurfaceNodes, extent, nodes_and_facets
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh


def tied_rows(
    V: fem.FunctionSpace,
    tagged_mesh: TaggedMesh,
    ties: Sequence[Tie],
    fixed: npt.NDArray[np.bool_],
) -> Constraints:
    """Return the rows of all ties. Collective.

    If a support or another tie holds a component of a node, the node hosts no row for this
    component. The neighbours of this node take over its dual function, as in mortar contact.

    Args:
        V: Displacement space.
        tagged_mesh: Mesh with named bodies and surfaces.
        ties: The ties.
        fixed: Components at each local node that supports hold, shape (num_nodes, gdim).

    Raises:
        InputError: For unknown names, for surfaces that are nowhere opposite each other or are too
            far apart, or if supports hold hosts.
    """
    taken = fixed.copy()
    parts: list[Constraints] = []
    for number, tie in enumerate(ties):
        parts += _rows(V, tagged_mesh, tie, number, taken)
    return joined(V, parts)


def _rows(
    V: fem.FunctionSpace,
    tagged_mesh: TaggedMesh,
    tie: Tie,
    number: int,
    taken: npt.NDArray[np.bool_],
) -> list[Constraints]:
    """Return the rows of one tie for each component, and mark the host components as taken.

    Collective.
    """
    place = f"tie {number + 1} ('{tie.primary}', '{tie.secondary}')"
    if tie.primary == tie.secondary:
        raise InputError(f"{place}: a surface cannot be tied to itself; name two surfaces.")
    surfaces = [
        Surface(name, *nodes_and_facets(V, tagged_mesh, name, taken))
        for name in (tie.primary, tie.secondary)
    ]
    gdim = V.mesh.geometry.dim

    def able(nodes: SurfaceNodes) -> list[PairFlags]:
        first = np.zeros(
            len(nodes), dtype=np.bool_
        )  # a node on an edge is listed once per face, but hosts once
        first[np.unique(nodes["node"], return_index=True)[1]] = True
        return [first & nodes["free"][:, axis] for axis in range(gdim)]

    comm = V.mesh.comm
    kinematics = tagged_mesh.kinematics
    chosen = choose_side(comm, place, surfaces, tie.hosts, able, kinematics, onward=False)
    size = extent(comm, np.concatenate([surface.nodes["x"] for surface in surfaces]))
    apart = np.abs(chosen.distances.along)
    seen = np.isfinite(apart) & (apart > chosen.distances.slack)
    farthest = comm.allreduce(float(apart[seen].max(initial=0)), MPI.MAX)
    bridged = 0.01  # largest distance between tied surfaces, relative to their size
    if farthest > bridged * size:
        raise InputError(
            f"{place}: the surfaces are up to {farthest:.3g} apart, so moments of forces across "
            "the gap would not balance; tie surfaces that touch, or move one of the bodies."
        )
    parts = []
    for axis, rows in enumerate(chosen.rows):
        host = chosen.host.nodes["node"][rows.place]
        taken[host, axis] = True
        direction = np.eye(gdim)[axis]
        parts.append(
            make_constraints(
                V,
                host,
                np.zeros(len(host)),
                np.tile(direction, (len(host), 1)),
                np.full(len(host), number, dtype=np.int32),
                [
                    (rows.row[side], rows.node[side], rows.weight[side][:, None] * direction)
                    for side in (rows.own, ~rows.own)
                ],
            )
        )
    return [replace(part, in_mean=True) for part in parts]
