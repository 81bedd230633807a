"""Contact of named surfaces with each other and with rigid obstacles: inequalities at nodes."""

from collections.abc import Sequence
from dataclasses import dataclass

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from perfplast_fenicsx.contact.contact import Contact
from perfplast_fenicsx.contact.gap_function import (
    MATCHING_TOLERANCE,
    normals_and_gaps,
    without_overlap,
)
from perfplast_fenicsx.contact.node_matching import Matching, match_rows
from perfplast_fenicsx.contact.obstacles import Obstacle
from perfplast_fenicsx.contact.surface_normals import face_nodes
from perfplast_fenicsx.errors import InputError, raise_together
from perfplast_fenicsx.mesh.connected_bodies import Bodies
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.parallel import Rows, bounding_box, send_rows

LEAST_COSINE = 0.1
"""A displacement component may stand for the normal if its share of it is at least this."""

RIGID = -1
"""Body of the guest where it is a rigid obstacle."""


@dataclass(frozen=True)
class ContactPairs:
    """The inequalities (u_a − u_b)·n ≤ g, each kept by the rank that owns its *host* node.

    One displacement component of the host, which is a unless supports leave a no freedom along n,
    will be replaced by the jump (:mod:`jump_basis`). At a rigid obstacle u_b = 0.

    Attributes:
        host: Local block dof of the host node, shape (num_pairs,).
        guest: Global block dof of the other node; the host's own at obstacles.
        sign: 1 if the host is a, −1 if it is b.
        normal: Unit normal out of a's body, shape (num_pairs, gdim): the mean of both surfaces'
            normals, so that it is the same seen from either.
        gap: Initial gap g (length).
        contact: Number of the contact from 0; obstacles count on behind the contacts.
        host_free: Components of the host no support holds, shape (num_pairs, gdim).
        guest_free: The same of the guest; none at obstacles.
        guest_body: Body of the guest (:class:`connected_bodies.Bodies`), or :data:`RIGID`.
        guest_x: Coordinates of the guest, shape (num_pairs, 3).
    """

    host: npt.NDArray[np.int32]
    guest: npt.NDArray[np.int64]
    sign: npt.NDArray[np.float64]
    normal: npt.NDArray[np.float64]
    gap: npt.NDArray[np.float64]
    contact: npt.NDArray[np.int32]
    host_free: npt.NDArray[np.bool_]
    guest_free: npt.NDArray[np.bool_]
    guest_body: npt.NDArray[np.int32]
    guest_x: npt.NDArray[np.float64]

    def __repr__(self) -> str:
        return f"ContactPairs({len(self.host)} hosted by this rank)"


def find_pairs(
    V: fem.FunctionSpace,
    assembly: TaggedMesh,
    bodies: Bodies,
    contacts: Sequence[Contact],
    obstacles: Sequence[Obstacle],
    fixed: npt.NDArray[np.bool_],
) -> ContactPairs:
    """Find the inequalities of all contacts and obstacles. Collective.

    Args:
        V: Displacement space.
        assembly: Mesh with names.
        bodies: Which node belongs to which body.
        contacts: What is in contact.
        obstacles: What does not move.
        fixed: Components held by supports at each local node, shape (num_nodes, gdim).

    Raises:
        InputError: Unknown names, surfaces whose nodes do not match or that do not face each other,
            an obstacle that does not fit the mesh, overlap, or a negative gap.
    """
    comm, gdim = V.mesh.comm, V.mesh.geometry.dim
    found = [np.zeros((0, 9 + 3 * gdim))]
    for order, contact in enumerate(contacts):
        place = f"contact {order + 1} ('{contact.primary}', '{contact.secondary}')"
        if contact.primary == contact.secondary:
            raise InputError(f"{place}: a surface cannot touch itself; name two surfaces.")
        first, second = (
            _rows(V, assembly, bodies, surface, fixed)
            for surface in (contact.primary, contact.secondary)
        )
        size = _diagonal(comm, np.concatenate([first, second]))
        matching = match_rows(comm, first, second, slice(8, 8 + gdim), MATCHING_TOLERANCE * size)
        normal, gap = normals_and_gaps(comm, place, contact.gap, matching, size, gdim)
        found.append(_to_hosts(comm, matching, normal, gap, order))
    for order, obstacle in enumerate(obstacles):
        place = f"obstacle {order + 1} ({type(obstacle).__name__.lower()} at '{obstacle.on}')"
        rows = _rows(V, assembly, bodies, obstacle.on, fixed)
        found.append(_at_obstacle(comm, place, obstacle, rows, len(contacts) + order, gdim))
    rows = np.concatenate(found)
    host, guest, sign, gap, number, guest_body = rows[:, :6].T
    normal, host_free, guest_free = np.split(rows[:, 9:], 3, axis=1)
    return ContactPairs(
        host.astype(np.int32),
        guest.astype(np.int64),
        sign,
        normal,
        gap,
        number.astype(np.int32),
        host_free.astype(bool),
        guest_free.astype(bool),
        guest_body.astype(np.int32),
        rows[:, 6:9],
    )


def pair_functionals(
    V: fem.FunctionSpace, bodies: Bodies, pairs: ContactPairs
) -> npt.NDArray[np.float64]:
    """The jump (u_a − u_b)·n of each pair hosted here, as functional of the rigid motions.

    Returns:
        Shape (num_pairs, bodies.count * bodies.num_modes).
    """
    normal = pairs.sign[:, None] * pairs.normal
    host_x = V.tabulate_dof_coordinates()[pairs.host]
    host = bodies.functionals(bodies.of_node[pairs.host], host_x, normal)
    moves = pairs.guest_body != RIGID
    guest = bodies.functionals(np.where(moves, pairs.guest_body, 0), pairs.guest_x, normal)
    return host - moves[:, None] * guest


def _rows(
    V: fem.FunctionSpace,
    assembly: TaggedMesh,
    bodies: Bodies,
    surface: str,
    fixed: npt.NDArray[np.bool_],
) -> Rows:
    """Rows (x y z | rank, local, global, body, size | normal | free) of a surface's nodes."""
    faces = face_nodes(V, assembly, surface)
    node, x = faces.node, V.tabulate_dof_coordinates()[faces.node]
    ranks = np.full(len(node), V.mesh.comm.rank)
    numbers = [ranks, node, V.dofmap.index_map.local_to_global(node), bodies.of_node[node]]
    columns = [x, *numbers, faces.size, faces.normal, ~fixed[node]]
    return np.column_stack(columns).astype(np.float64)


def _diagonal(comm: MPI.Intracomm, rows: Rows) -> float:
    """Size of the box around the nodes of all ranks."""
    low, high = bounding_box(comm, rows[:, :3])
    return float(np.linalg.norm(high - low))


def _to_hosts(
    comm: MPI.Intracomm,
    matching: Matching,
    normal: npt.NDArray[np.float64],
    gap: npt.NDArray[np.float64],
    number: int,
) -> Rows:
    """Choose each pair's host, and send it there.

    Returns:
        Rows (host, guest, sign, gap, number, guest body | guest x y z | normal | host free |
        guest free) of the pairs hosted by this rank.
    """
    a, b = matching.first, matching.second
    free_a, free_b = (rows[:, 8 + normal.shape[1] :] for rows in (a, b))
    able_a, able_b = _able(normal, free_a), _able(normal, free_b)
    on_a = able_a[:, None]
    host, guest = np.where(on_a, a, b), np.where(on_a, b, a)
    frees = [np.where(on_a, free_a, free_b), np.where(on_a, free_b, free_a)]
    sign, numbers = np.where(able_a, 1.0, -1.0), np.full(len(a), number)
    first = [host[:, 4], guest[:, 5], sign, gap, numbers, guest[:, 6], guest[:, :3]]
    movable = able_a | able_b
    rows = np.column_stack([*first, normal, *frees])[movable]
    return send_rows(comm, rows, host[movable, 3].astype(np.int64))


def _at_obstacle(
    comm: MPI.Intracomm, place: str, obstacle: Obstacle, rows: Rows, number: int, gdim: int
) -> Rows:
    """Rows like those of :func:`_to_hosts` of a surface's nodes, each once. Collective."""
    rows = rows[np.unique(rows[:, 4], return_index=True)[1]]
    gap: npt.NDArray[np.float64] = np.zeros(len(rows))
    into: npt.NDArray[np.float64] = np.zeros((len(rows), gdim))
    message: str | None = None
    try:
        gap, into = obstacle.towards(rows[:, :gdim])
    except InputError as error:
        message = f"{place}: {error}"
    raise_together(comm, message)
    gap = without_overlap(comm, place, gap, _diagonal(comm, rows))
    free = rows[:, 8 + gdim :]
    ones, none = np.ones(len(rows)), np.zeros_like(free)
    first = [rows[:, 4], rows[:, 5], ones, gap, number * ones, RIGID * ones, rows[:, :3]]
    return np.column_stack([*first, into, free, none])[_able(into, free)]


def _able(normal: npt.NDArray[np.float64], free: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
    """Whether supports leave a node enough freedom along the normal to host the jump."""
    able: npt.NDArray[np.bool_] = (np.abs(normal) * free).max(axis=1, initial=0) >= LEAST_COSINE
    return able
