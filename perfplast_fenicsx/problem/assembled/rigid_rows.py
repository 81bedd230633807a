"""Assemble rigid surfaces as rows B u = 0: all nodes follow two nodes, or three in 3D.

The leading nodes a, b, c are far apart. Their free unknowns are u_a, the components of u_b across
a–b and, in 3D, the component of u_c out of the plane a, b, c: 3 or 6 in all. The displacement of
each other node on the surface is linear in these unknowns:

    u(x) = u_a + ω × (x − a)   with   ω = W (u_a, u_b, u_c)
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats, Ints, Longs
from perfplast_fenicsx.contact.rows.constraints import Constraints, make_constraints
from perfplast_fenicsx.errors import InputError, raise_together
from perfplast_fenicsx.mesh.kinematics import ON_AXIS
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.problem.declared.loads import Force, Load
from perfplast_fenicsx.problem.declared.supports import AXES, RigidSurface, turned


@dataclass(frozen=True)
class Leaders:
    """The nodes of a rigid surface that all other nodes follow.

    Attributes:
        number: Global block dofs of the leaders, shape (2,) or (3,).
        x: Coordinates of the leaders, shape (2, 2) or (3, 3).
        frame: Unit vectors along a–b, across a–b and, in 3D, out of the plane of the leaders.
    """

    number: Longs
    x: Floats
    frame: Floats

    def follow(self, x: Floats) -> Floats:
        """Return the displacements of points as coefficients of the leaders' displacements.

        Args:
            x: Points, shape (n, gdim).

        Returns:
            Coefficients, shape (n, gdim, leaders, gdim).
        """
        gdim = len(self.frame)
        turns = self._turns()
        arms = x - self.x[0]
        axes = np.eye(2 * gdim - 3)
        moved = np.stack([turned(axis, arms) for axis in axes], axis=-1)  # (n, gdim, turns)
        found = np.einsum("nit,tlk->nilk", moved, turns)
        found[:, :, 0] += np.eye(gdim)
        return found

    def _turns(self) -> Floats:
        """Return W, which maps the leaders' displacements to ω, shape (1 or 3, leaders, gdim)."""
        along, across = self.frame[:2]
        length = float(np.linalg.norm(self.x[1] - self.x[0]))
        if len(self.frame) == 2:
            turn = np.zeros((1, 2, 2))
            turn[0, 1], turn[0, 0] = across / length, -across / length
            return turn
        out = self.frame[2]
        arm = self.x[2] - self.x[0]
        local = np.zeros((3, 3, 3))  # rotations about the axes of the frame
        local[2, 1] = across / length
        local[1, 1] = -out / length
        local[0, 2] = out
        local[0] += (arm @ along) * local[1]
        local[0] /= arm @ across
        local[:, 0] = -local[:, 1:].sum(axis=1)
        return np.einsum("ft,flk->tlk", self.frame, local)

    def forces(self, force: Floats, moment: Floats, point: Floats) -> Floats:
        """Return the smallest forces on the leaders with a given resultant, shape (leaders, gdim).

        Args:
            force: The force, shape (gdim,).
            moment: The moment about ``point``, shape (1,) or (3,).
            point: The point where the force acts, shape (gdim,).
        """
        gdim = len(self.frame)
        arms = self.x - point
        turns = [turned(axis, arms).ravel() for axis in np.eye(2 * gdim - 3)]
        shifts = [np.tile(axis, len(arms)) for axis in np.eye(gdim)]
        wanted = np.concatenate([force, moment])
        found = np.linalg.lstsq(np.array([*shifts, *turns]), wanted, rcond=None)[0]
        return np.asarray(found.reshape(-1, gdim))


def find_leaders(V: fem.FunctionSpace, tagged_mesh: TaggedMesh, surface: str) -> Leaders:
    """Return the leaders of a surface; they do not depend on the number of ranks. Collective.

    Raises:
        InputError: For an unknown name, or if there are no nodes, or if they coincide or, in 3D,
            lie on a line.
    """
    nodes = surface_nodes_of(V, tagged_mesh, surface)
    gdim, comm = V.mesh.geometry.dim, V.mesh.comm
    x = V.tabulate_dof_coordinates()[nodes, :gdim]
    number = V.dofmap.index_map.local_to_global(nodes)
    count, total = comm.allreduce(len(x)), comm.allreduce(x.sum(axis=0))
    if not count:
        raise InputError(f"the rigid surface '{surface}' has no nodes; name another surface.")
    middle = total / count
    size = comm.allreduce(float(np.linalg.norm(x - middle, axis=1).max(initial=0)), MPI.MAX)

    # Distances that differ by less, relative to the size of the surface, count as equal. The
    # coordinates then decide, so the choice does not depend on the number of ranks.
    alike = 1e-9

    def leading(distance: Floats) -> tuple[float, int, Floats]:
        return farthest(comm, distance, number, x, alike * size)

    _, a, x_a = leading(np.linalg.norm(x - middle, axis=1))
    length, b, x_b = leading(np.linalg.norm(x - x_a, axis=1))
    chosen, places, height = [a, b], [x_a, x_b], length
    # Least distance between leaders, and of c from the line a–b, relative to the surface.
    in_line = 1e-6
    along = (x_b - x_a) / max(length, in_line * size, np.finfo(float).tiny)
    if gdim == 2:
        frame = [along, np.array([-along[1], along[0]])]
    else:
        arms = x - x_a
        height, c, x_c = leading(np.linalg.norm(arms - np.outer(arms @ along, along), axis=1))
        across = x_c - x_a - ((x_c - x_a) @ along) * along
        across /= max(height, in_line * size, np.finfo(float).tiny)
        chosen, places = [a, b, c], [x_a, x_b, x_c]
        frame = [along, across, np.cross(along, across)]
    if not (length > in_line * size and height > in_line * size):
        kind = "coincide" if gdim == 2 else "lie on a line"
        raise InputError(
            f"the nodes of the rigid surface '{surface}' {kind}, so the rotation of the surface is "
            "undefined; name a larger surface."
        )
    return Leaders(np.array(chosen), np.array(places), np.array(frame))


def surface_nodes_of(V: fem.FunctionSpace, tagged_mesh: TaggedMesh, surface: str) -> Ints:
    """Return the local block dofs of a surface's owned nodes, except on the axis of revolution."""
    fdim = tagged_mesh.mesh.topology.dim - 1
    nodes = fem.locate_dofs_topological(V, fdim, tagged_mesh.facets(surface))
    nodes = nodes[nodes < V.dofmap.index_map.size_local]
    carried = tagged_mesh.kinematics.carried(V.tabulate_dof_coordinates()[nodes])
    most = V.mesh.comm.allreduce(float(carried.max(initial=0.0)), MPI.MAX)
    return np.asarray(nodes[carried > ON_AXIS * most])


def rigid_rows(
    V: fem.FunctionSpace,
    tagged_mesh: TaggedMesh,
    surfaces: Sequence[RigidSurface],
    taken: npt.NDArray[np.bool_],
) -> list[Constraints]:
    """Return the rows of the surfaces that are free to move. Collective.

    Args:
        V: Displacement space.
        tagged_mesh: Mesh with named bodies and surfaces.
        surfaces: The rigid surfaces.
        taken: Components of local nodes that supports hold or ties eliminate, shape (num_nodes,
            gdim). The function adds the components of the rigid surfaces.

    Raises:
        InputError: For an unknown name, keys that exclude each other, or a surface in a point or on
            a line. Also raised if a surface shares nodes with supports, ties or other rigid
            surfaces.
    """
    gdim = V.mesh.geometry.dim
    parts: list[Constraints] = []
    for surface in surfaces:
        if not surface.free:
            if surface.held:
                raise InputError(
                    f"the rigid surface '{surface.on}' has both held = '{surface.held}' "
                    "and a prescribed motion; remove one of them."
                )
            continue
        if surface.components != AXES:
            raise InputError(
                f"components = '{surface.components}' of the rigid surface '{surface.on}' applies "
                "only to a prescribed motion; give a displacement or rotation, or remove "
                "components."
            )
        leaders = find_leaders(V, tagged_mesh, surface.on)
        nodes = surface_nodes_of(V, tagged_mesh, surface.on)
        known = surface.axes(gdim) if surface.held else []
        free = [axis for axis in range(gdim) if axis not in known]
        held = taken[nodes][:, free].any()
        raise_together(
            V.mesh.comm,
            f"the rigid surface '{surface.on}' shares nodes with a support, a tie or "
            "another rigid surface; separate the surfaces, or assign the shared nodes to "
            "one of them."
            if held
            else None,
        )
        taken[fem.locate_dofs_topological(V, gdim - 1, tagged_mesh.facets(surface.on))] = True
        if known:
            carried = tagged_mesh.kinematics.carried
            parts.append(_rows_of_slide(V, leaders, carried, nodes, free, len(parts)))
        else:
            parts.append(_rows(V, leaders, nodes, len(parts)))
    return parts


def _rows(V: fem.FunctionSpace, leaders: Leaders, nodes: Ints, number: int) -> Constraints:
    """Return a row for each component of a node that follows the leaders. Collective."""
    gdim = V.mesh.geometry.dim
    numbers = V.dofmap.index_map.local_to_global(nodes)
    which = np.full(len(nodes), -1)
    for place, leader in enumerate(leaders.number):
        which[numbers == leader] = place
    plain = np.flatnonzero(which < 0)
    row = [np.repeat(plain, gdim)]
    direction = [np.tile(np.eye(gdim), (len(plain), 1))]
    for place in range(1, len(leaders.number)):
        here = np.flatnonzero(which == place)
        row.append(np.repeat(here, place))
        direction.append(np.tile(leaders.frame[:place], (len(here), 1)))
    of_node, along = np.concatenate(row), np.concatenate(direction)
    x = V.tabulate_dof_coordinates()[nodes, :gdim]
    led = np.einsum("ni,nilk->nlk", along, leaders.follow(x)[of_node])
    every = np.arange(len(of_node))
    terms = [(every, numbers[of_node], along)]
    terms += [
        (every, np.full(len(every), leader), -led[:, place])
        for place, leader in enumerate(leaders.number)
    ]
    host = nodes[of_node].astype(np.int32)
    surface = np.full(len(host), number, dtype=np.int32)
    return make_constraints(V, host, np.zeros(len(host)), along, surface, terms)


def _rows_of_slide(
    V: fem.FunctionSpace,
    leaders: Leaders,
    carried: Callable[[Floats], Floats],
    nodes: Ints,
    free: Sequence[int],
    number: int,
) -> Constraints:
    """Return the rows for each node's free components, which follow one leader. Collective."""
    gdim, leader = V.mesh.geometry.dim, leaders.number[0]
    numbers = V.dofmap.index_map.local_to_global(nodes)
    others = np.flatnonzero(numbers != leader)
    of_node = np.repeat(others, len(free))
    along = np.tile(np.eye(gdim)[list(free)], (len(others), 1))
    every = np.arange(len(of_node))
    x = V.tabulate_dof_coordinates()[nodes[of_node], :gdim]
    led = carried(x)[:, None] / carried(leaders.x[:1]) * along
    terms = [(every, numbers[of_node], along), (every, np.full(len(every), leader), -led)]
    host = nodes[of_node].astype(np.int32)
    surface = np.full(len(host), number, dtype=np.int32)
    return make_constraints(V, host, np.zeros(len(host)), along, surface, terms)


def farthest(
    comm: MPI.Intracomm, distance: Floats, number: Longs, x: Floats, alike: float
) -> tuple[float, int, Floats]:
    """Return the largest distance, its node and the node's coordinates. Collective.

    Among nodes with equal distances, the coordinates decide.
    """
    largest = comm.allreduce(float(distance.max(initial=0)), MPI.MAX)
    near = np.flatnonzero(distance >= largest - alike)
    order = np.lexsort(np.round(x[near] / max(alike, np.finfo(float).tiny)).T)
    mine = [(tuple(x[i]), int(number[i])) for i in near[order[:1]]]
    best = min(
        (entry for each in comm.allgather(mine) for entry in each),
        key=lambda entry: tuple(np.round(np.array(entry[0][::-1]) / max(alike, 1e-300))),
    )
    return largest, best[1], np.array(best[0])


def rigid_resultants(
    surfaces: Sequence[RigidSurface], loads: Sequence[Load], gdim: int
) -> tuple[Floats, Floats]:
    """Return the force and the moment on each rigid surface at ζ = 1.

    Args:
        surfaces: Rigid surfaces.
        loads: Loads; the function uses only the forces on these surfaces.
        gdim: 2 or 3.

    Returns:
        The forces, shape (num_surfaces, gdim), and the moments about the origin, shape
        (num_surfaces, 1 or 3).
    """
    numbers = {surface.on: number for number, surface in enumerate(surfaces)}
    forces = np.zeros((len(surfaces), gdim))
    moments = np.zeros((len(surfaces), 2 * gdim - 3))
    for load in loads:
        if isinstance(load, Force) and load.on in numbers:
            force, moment, point = load.vectors(gdim)
            forces[numbers[load.on]] += force
            moments[numbers[load.on]] += moment + moments_of(point[None], force[None])[0]
    return forces, moments


def moments_of(arms: Floats, forces: Floats) -> Floats:
    """Return the moments of forces, shape (n, 1 or 3); arms and forces have shape (n, gdim)."""
    axes = np.eye(2 * arms.shape[1] - 3)
    return np.stack([np.einsum("ni,ni->n", turned(e, arms), forces) for e in axes], axis=1)
