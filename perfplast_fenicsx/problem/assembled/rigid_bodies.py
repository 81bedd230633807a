"""Model rigid bodies in levels by rows B u = 0, with which all nodes of a body follow a few nodes.

A body has three motions q in plane meshes and six in 3D. The components that supports hold, and
displacements of up to three nodes, determine q. All other displacements of the body are linear
functions of q.
The forces of the rows do no work on rigid motions. So these forces balance on each body, and the
loads reach its supports, contacts and ties.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats, Ints, Longs
from perfplast_fenicsx.contact.declared.contact import Contact, Tie
from perfplast_fenicsx.contact.rows.constraints import Constraints, make_constraints
from perfplast_fenicsx.errors import InputError, raise_together
from perfplast_fenicsx.materials.elastic import Rigid
from perfplast_fenicsx.materials.law import Material
from perfplast_fenicsx.mesh.connected_bodies import components
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.parallel import bounding_box, sums_at
from perfplast_fenicsx.problem.assembled.rigid_rows import farthest
from perfplast_fenicsx.problem.declared.given import Given

ROUNDING = 1e-9
"""Motions below this size are rounding errors, for a body of unit size."""


@dataclass(frozen=True)
class Supported:
    """Components that supports hold, as arrays over local nodes including ghosts.

    Attributes:
        fixed: Whether supports hold each component, shape (num_nodes, gdim).
        displacement: u_D (length): the constant part and the part times ζ, shape (2, num_nodes,
            gdim).
        holder: Number of the support that holds each component, −1 if none does, shape (num_nodes,
            gdim).
    """

    fixed: npt.NDArray[np.bool_]
    displacement: Floats
    holder: Ints


@dataclass(frozen=True)
class RigidBodies:
    """Bodies whose nodes follow rigid motions.

    Attributes:
        of_node: Number of the rigid body to which each local node (including ghosts) belongs; −1 in
            deformable bodies.
        rows: The rows of each rigid body.
        moving: Whether each node belongs to a rigid body and has a component that supports do not
            hold, shape (num_nodes,).
    """

    of_node: Ints
    rows: list[Constraints]
    moving: npt.NDArray[np.bool_]


def rigid_bodies(
    V: fem.FunctionSpace,
    tagged_mesh: TaggedMesh,
    materials: Mapping[str, Material],
    supported: Supported,
) -> RigidBodies:
    """Return the bodies whose material is a :class:`Rigid`, with their rows. Collective.

    The function adds to ``supported`` all components that the supports of a body imply, with their
    displacements.

    Args:
        V: Displacement space.
        tagged_mesh: Mesh with named bodies and surfaces.
        materials: Material of each volume.
        supported: Components that supports hold, with their displacements.

    Raises:
        InputError: If the mesh is axisymmetric, or if supports prescribe displacements of a body
            that do not form a rigid motion.
    """
    if tagged_mesh.axisymmetric:
        raise InputError(
            "a body of revolution has law = 'rigid', which is not supported where load levels are "
            "solved; give law = 'elastic', and make young 1e5 times as large as in the adjacent "
            "bodies."
        )
    count, of_node = _find(V, tagged_mesh, materials)
    rows = []
    for number in range(count):
        nodes = np.flatnonzero(of_node == number)
        body = _Body(V, tagged_mesh, nodes)
        held = body.held_rows(supported.fixed)
        body.imply(held, supported)
        rows.append(body.rows(held, supported.fixed, number))
    moving = (of_node >= 0) & ~supported.fixed.all(axis=1)
    return RigidBodies(of_node, rows, moving)


def check_touching(
    V: fem.FunctionSpace, tagged_mesh: TaggedMesh, given: Given, bodies: RigidBodies
) -> None:
    """Refuse moving rigid bodies that touch each other or obstacles, or that guides support.

    Collective.

    In each row of a contact or a tie, at least one body must be deformable.

    Raises:
        InputError: If such bodies touch or are guided; the message names the surfaces.
    """
    comm, fdim = V.mesh.comm, V.mesh.topology.dim - 1

    def moves(name: str) -> bool:
        nodes = fem.locate_dofs_topological(V, fdim, tagged_mesh.facets(name))
        return bool(comm.allreduce(bool(bodies.moving[nodes].any()), MPI.LOR))

    pairs: list[Contact | Tie] = [*given.contacts, *given.ties]
    for pair in pairs:
        if moves(pair.primary) and moves(pair.secondary):
            raise InputError(
                f"the surfaces '{pair.primary}' and '{pair.secondary}' both belong to bodies with "
                "law = 'rigid', so load levels cannot determine the forces between them; give one "
                "of the bodies law = 'elastic', and make young 1e5 times as large as in the "
                "adjacent bodies."
            )
    for obstacle in given.obstacles:
        if moves(obstacle.on):
            raise InputError(
                f"the obstacle on '{obstacle.on}' touches a body with law = 'rigid', which is not "
                "supported where load levels are solved; give this body law = 'elastic', and make "
                "young 1e5 times as large as in the adjacent bodies."
            )
    for support in given.supports:
        if support.guides and moves(support.on):
            raise InputError(
                f"components = 'normal' of the support on '{support.on}' is not supported for "
                "bodies with law = 'rigid' where load levels are solved; give letters of axes."
            )


class _Body:
    """A rigid body: its local nodes, and their displacements in the motions of the body."""

    def __init__(self, V: fem.FunctionSpace, tagged_mesh: TaggedMesh, nodes: Longs) -> None:
        """Compute the size of the body and its motions at the nodes. Collective.

        Args:
            V: Displacement space.
            tagged_mesh: Mesh with named bodies and surfaces.
            nodes: Local nodes of the body, including ghosts.
        """
        self._V, self._kinematics = V, tagged_mesh.kinematics
        self._comm, self._nodes = V.mesh.comm, nodes
        x = V.tabulate_dof_coordinates()[nodes]
        self._owned = nodes < V.dofmap.index_map.size_local
        low, high = bounding_box(self._comm, x)
        size = float(np.linalg.norm(high - low))
        self._x: Floats = np.asarray((x - (low + high) / 2) / size, dtype=np.float64)
        self._motions = self._kinematics.rigid_modes(self._x)
        self._numbers = V.dofmap.index_map.local_to_global(nodes.astype(np.int32))
        self._gdim, self._count = self._motions.shape[1:]

    def held_rows(self, fixed: npt.NDArray[np.bool_]) -> "_Leaders":
        """Return a maximal set of independent components that supports hold. Collective."""
        found = _Leaders.none(self._gdim, self._count)
        held = fixed[self._nodes] & self._owned[:, None]
        node, axis = np.nonzero(held)
        # A support holds a motion only if the held component of this motion is larger, relative to
        # the size of the body.
        least = 1e-6
        place: Floats = np.column_stack([self._x[node], axis.astype(np.float64)])
        number = self._numbers[node] * self._gdim + axis
        any_held = self._comm.allreduce(len(node)) > 0
        while any_held and len(found) < self._count:
            left = self._motions[node, axis] @ found.complement()
            sizes = np.linalg.norm(left, axis=1)
            largest, which, at = farthest(self._comm, sizes, number, place, ROUNDING)
            if largest <= least:
                break
            along = np.eye(self._gdim)[[which % self._gdim]]
            motions = self._kinematics.rigid_modes(at[None, :3])[0]
            found = found.and_at(which // self._gdim, along, motions)
        return found

    def imply(self, held: "_Leaders", supported: Supported) -> None:
        """Add to ``supported`` all components that ``held`` determines. Collective.

        Raises:
            InputError: If the supports prescribe a motion that is not a rigid motion of the body.
        """
        if not len(held):
            return
        fixed, nodes, comm = supported.fixed, self._nodes, self._comm
        left = np.linalg.norm(self._motions @ held.complement(), axis=2)
        implied = left <= ROUNDING
        known = fixed[nodes]
        mine = known & self._owned[:, None]
        rows = self._motions[mine]
        gram = comm.allreduce(rows.T @ rows)
        wanted: Floats = supported.displacement[:, nodes]
        apart = 0.0
        most = comm.allreduce(float(np.abs(wanted).max(initial=0)), MPI.MAX)
        for part in range(len(wanted)):
            given = wanted[part]
            right = comm.allreduce(rows.T @ given[mine])
            moved = self._motions @ np.linalg.lstsq(gram, right, rcond=ROUNDING)[0]
            apart = max(apart, float(np.abs(moved - given)[known].max(initial=0)))
            supported.displacement[part, nodes] = np.where(implied & ~known, moved, given)
        rounding = 1e-9  # relative to the largest displacement
        message = None
        if comm.allreduce(apart, MPI.MAX) > rounding * most:
            message = (
                "supports move nodes of a body with law = 'rigid' in a way that is not a rigid "
                "motion; give values that together form a rigid motion, or remove all but one of "
                "these supports."
            )
        raise_together(comm, message)
        holder = supported.holder[nodes]
        none = np.iinfo(np.int32).max
        first: Longs = np.where(holder >= 0, holder, none).min(axis=0, initial=none)
        comm.Allreduce(MPI.IN_PLACE, first, MPI.MIN)
        first = np.where(first == none, first.min(), first)
        new = implied & ~known
        supported.holder[nodes] = np.where(new, first, holder)
        supported.fixed[nodes] = known | implied

    def rows(self, held: "_Leaders", fixed: npt.NDArray[np.bool_], number: int) -> Constraints:
        """Return the rows for components that are neither held nor leaders. Collective.

        Args:
            held: The leaders that supports hold.
            fixed: Components that supports hold, shape (num_nodes, gdim).
            number: Number of the body.
        """
        gdim = self._gdim
        free = ~fixed[self._nodes]
        owned, taken, leaders = self._owned, ~free, held
        node: list[Longs] = []
        along: list[Floats] = []
        while len(leaders) < self._count:
            left = (self._motions @ leaders.complement()) * free[:, :, None]
            sizes = np.linalg.norm(left, axis=(1, 2))
            told = (self._comm, sizes[owned], self._numbers[owned], self._x[owned])
            _, which, at = farthest(*told, ROUNDING)
            here = np.flatnonzero(owned & (self._numbers == which))
            mine = free[here[0]].tolist() if len(here) else None
            loose = next(it for it in self._comm.allgather(mine) if it is not None)
            axes = np.eye(gdim)[loose]
            motions = self._kinematics.rigid_modes(at[None])[0]
            parts, strengths, _ = np.linalg.svd(axes @ motions @ leaders.complement())
            # A direction becomes a leader only if its freedom is larger, relative to the largest.
            least = 1e-6
            lead = int((strengths > least * strengths[0]).sum())
            directions = parts.T @ axes
            leaders = leaders.and_at(which, directions[:lead], motions)
            rest = directions[lead:]
            node.append(np.repeat(here, len(rest)))
            along.append(np.tile(rest, (len(here), 1)))
            taken = taken | (self._numbers == which)[:, None]
        plain, axis = np.nonzero(~taken & owned[:, None])
        node.append(plain)
        along.append(np.eye(gdim)[axis])
        return self._constraints(leaders, np.concatenate(node), np.concatenate(along), number)

    def _constraints(
        self, leaders: "_Leaders", node: Longs, along: Floats, number: int
    ) -> Constraints:
        """Return a row for each of the given directions at nodes of the body. Collective."""
        every, host = np.arange(len(node)), self._nodes[node].astype(np.int32)
        shares = np.einsum("ni,nim->nm", along, self._motions[node]) @ leaders.motions_of()
        terms = [(every, self._numbers[node], along)]
        terms += [
            (every, np.full(len(every), leader), -shares[:, [place]] * direction)
            for place, (leader, direction) in enumerate(
                zip(leaders.number, leaders.along, strict=True)
            )
        ]
        of_body = np.full(len(host), number, dtype=np.int32)
        return make_constraints(self._V, host, np.zeros(len(host)), along, of_body, terms)


@dataclass(frozen=True)
class _Leaders:
    """Displacements d·u of nodes, which determine motions of a body.

    Attributes:
        number: Global block dof of each node, shape (n,).
        along: Direction d of each leader, shape (n, gdim).
        rows: d·u in each motion of the body, shape (n, num_motions).
    """

    number: Longs
    along: Floats
    rows: Floats

    @classmethod
    def none(cls, gdim: int, count: int) -> "_Leaders":
        """Return an empty set of leaders for a body with ``count`` motions."""
        return cls(np.zeros(0, dtype=np.int64), np.zeros((0, gdim)), np.zeros((0, count)))

    def __len__(self) -> int:
        return len(self.number)

    def and_at(self, number: int, along: Floats, motions: Floats) -> "_Leaders":
        """Return these leaders and further directions ``along`` at a node.

        ``motions`` are the displacements of this node in the motions, shape (gdim, num_motions).
        """
        return _Leaders(
            np.append(self.number, np.full(len(along), number)),
            np.concatenate([self.along, along]),
            np.concatenate([self.rows, along @ motions]),
        )

    def complement(self) -> Floats:
        """Return an orthonormal basis of the motions that the leaders leave free, as columns."""
        if not len(self):
            return np.eye(self.rows.shape[1])
        return np.asarray(np.linalg.svd(self.rows)[2][len(self) :].T)

    def motions_of(self) -> Floats:
        """Return the motion for a unit displacement of each leader, as columns."""
        return np.asarray(np.linalg.inv(self.rows), dtype=np.float64)


def _find(
    V: fem.FunctionSpace, tagged_mesh: TaggedMesh, materials: Mapping[str, Material]
) -> tuple[int, Ints]:
    """Return the number of rigid bodies, and the body of each local node (−1 elsewhere).

    Collective.
    """
    comm, index_map = V.mesh.comm, V.dofmap.index_map
    names = sorted(name for name, of in materials.items() if isinstance(of, Rigid))
    cells = np.concatenate([np.zeros(0, dtype=np.int32), *map(tagged_mesh.cells, names)])
    corners = V.dofmap.list[cells]
    rigid = sums_at(index_map, 1, (np.unique(corners), 1.0))[:, 0] > 0
    others = np.flatnonzero(~rigid).astype(np.int32)
    pairs: Sequence[npt.NDArray[np.int32]] = [
        np.stack([np.repeat(corners[:, 0], corners.shape[1]), corners.ravel()], axis=1),
        np.stack([np.repeat(others[:1], len(others)), others], axis=1),
    ]
    _, piece = components(comm, index_map, np.concatenate(pairs))
    pieces = np.unique(np.concatenate(comm.allgather(np.unique(piece[rigid]))))
    of_node = np.where(rigid, np.searchsorted(pieces, piece), -1).astype(np.int32)
    return len(pieces), of_node
