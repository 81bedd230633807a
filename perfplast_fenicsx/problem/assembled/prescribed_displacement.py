"""Compute the prescribed motion of supports, obstacles and overlaps, and its effect on contact.

All prescribed motions are linear in the load factor ζ, which multiplies every part that is not
constant. u_D denotes the prescribed displacement.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
from dolfinx import default_scalar_type, fem, la

from perfplast_fenicsx.arrays import Floats, Ints
from perfplast_fenicsx.contact.declared.contact import Contact
from perfplast_fenicsx.contact.declared.obstacles import Obstacle, move_of
from perfplast_fenicsx.contact.rows.constraints import Constraints, Source
from perfplast_fenicsx.contact.rows.friction import Friction
from perfplast_fenicsx.contact.rows.rigid_motions import nodes_of
from perfplast_fenicsx.contact.surfaces.surface_facets import LEAST_COSINE, face_nodes
from perfplast_fenicsx.errors import InputError, raise_together
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.parallel import bounding_box
from perfplast_fenicsx.problem.declared.supports import AXES, RigidSurface, Support
from perfplast_fenicsx.rounding import ROUNDING


def conditions_at_rest(V: fem.FunctionSpace, held: npt.NDArray[np.bool_]) -> list[fem.DirichletBC]:
    """Return homogeneous conditions for increments at held components.

    The flags ``held`` have shape (num_nodes, gdim).
    """
    zero, gdim = default_scalar_type(0), held.shape[1]
    nodes = [np.flatnonzero(held[:, i]).astype(np.int32) for i in range(gdim)]
    return [fem.dirichletbc(zero, nodes[i] * gdim + i, V.sub(i)) for i in range(gdim)]


def known_displacements(
    V: fem.FunctionSpace, tagged_mesh: TaggedMesh, supports: Sequence[Support | RigidSurface]
) -> tuple[npt.NDArray[np.bool_], Floats, Ints]:
    """Return the components that supports and moving rigid surfaces prescribe, and their values.

    Collective.

    On the axis of a body of revolution, nodes cannot move radially, so this component is always
    held.

    Returns:
        Flags; displacements (length) as the constant part and the part times ζ, 0 at other
        components, shape (2, num_nodes, gdim); and the number of the first support that holds each
        component, −1 at others. Flags and numbers have shape (num_nodes, gdim). All arrays
        are at local nodes, including ghosts.

    Raises:
        InputError: For an unknown surface, invalid components, a value that is not finite, or two
            different values for one component of a node.
    """
    fdim, gdim = tagged_mesh.mesh.topology.dim - 1, tagged_mesh.mesh.geometry.dim
    x = V.tabulate_dof_coordinates()[:, :gdim]
    fixed, values, message = np.zeros(x.shape, dtype=bool), np.zeros((2, *x.shape)), None
    comm = tagged_mesh.mesh.comm
    holder = np.full(x.shape, -1, dtype=np.int32)
    rounding = 1e-12  # a relative difference below this value is a rounding error
    for number, support in enumerate(supports):
        nodes = fem.locate_dofs_topological(V, fdim, tagged_mesh.facets(support.on))
        given = np.zeros((2, len(nodes), gdim))
        given[0 if support.constant else 1] = motion_of(comm, support, x[nodes])
        most = tagged_mesh.mesh.comm.allreduce(float(np.abs(given).max(initial=0)), MPI.MAX)
        for axis in support.axes(gdim):
            old, new = values[:, nodes, axis], given[:, :, axis]
            apart = np.abs(old - new) > rounding * np.maximum(np.abs(old), most)
            differs = fixed[nodes, axis] & apart.any(axis=0)
            if differs.any():
                first = int(np.argmax(differs))
                message = (
                    f"the support on '{support.on}' moves nodes by {_told(new[:, first])} "
                    f"along {AXES[axis]}, but another support moves them by "
                    f"{_told(old[:, first])}; remove the component from one of the "
                    "supports, or separate their surfaces."
                )
            fresh = ~fixed[nodes, axis]
            holder[nodes[fresh], axis] = number
            values[:, nodes[fresh], axis] = new[:, fresh]
            fixed[nodes, axis] = True
    low, high = bounding_box(comm, V.tabulate_dof_coordinates())
    size = float(np.linalg.norm(high - low))
    on_axis = tagged_mesh.kinematics.held(V.tabulate_dof_coordinates(), size)
    if (on_axis & (values != 0)).any():
        message = (
            "a support moves nodes on the axis r = 0 along x, the radial direction; remove "
            "x from its components, or remove the axis from its surface."
        )
    raise_together(comm, message)
    return fixed | on_axis, values, holder


def motion_of(comm: MPI.Intracomm, support: Support | RigidSurface, x: Floats) -> Floats:
    """Return the displacement of points, or raise the same error on all ranks. Collective."""
    found, fault = np.zeros_like(x), None
    try:
        found = support.motion(x)
    except InputError as error:  # a formula may be undefined at a point of one rank
        fault = str(error)
    raise_together(comm, fault)
    return found


def _told(displacement: Floats) -> str:
    """Return a displacement in words: the part times ζ if there is one, else the constant part."""
    constant, growing = displacement
    return f"{growing:g} times ζ" if growing else f"{constant:g}"


def check_moved_surfaces(
    V: fem.FunctionSpace,
    tagged_mesh: TaggedMesh,
    moves: Sequence[tuple[str, Floats]],
    constraints: Constraints,
    fixed: npt.NDArray[np.bool_],
    prescribed: Floats,
) -> None:
    """Refuse normal motions of those nodes of contact surfaces that have no contact pair.

    A node has no pair if neither this node nor the opposite node is free along the normal.
    Collective.

    Args:
        V: Displacement space.
        tagged_mesh: Mesh with named bodies and surfaces.
        moves: The name of each surface in contact, and the prescribed motion of its opposite side
            at ζ = 1 (length), shape (gdim,): the motion of an obstacle, or 0.
        constraints: The contact rows of these surfaces.
        fixed: Components at each local node that supports hold, shape (num_nodes, gdim).
        prescribed: u_D: the constant part and the part times ζ, shape (2, num_nodes, gdim).

    Raises:
        InputError: If a support or an obstacle moves such a node or the opposite side; the message
            names the surface.
    """
    message = None
    paired = la.vector(V.dofmap.index_map, 1)
    paired.array[nodes_of(constraints.B, V.dofmap.index_map_bs)] = 1
    paired.scatter_forward()
    constant, growing = prescribed
    farthest = _farthest(V, prescribed)
    for name, move in moves:
        faces = face_nodes(V, tagged_mesh, name)
        given = (constant[faces.node], growing[faces.node] - move)
        along = np.max([np.abs(np.sum(faces.normal * u, axis=1)) for u in given], axis=0)
        freedom = (np.abs(faces.normal) * ~fixed[faces.node]).max(axis=1, initial=0)
        unseen = (freedom < LEAST_COSINE) & (paired.array[faces.node] == 0)
        largest = max(farthest, np.abs(move).max())
        if (unseen & (along > ROUNDING * largest)).any():
            message = (
                "supports prescribe the normal displacements of nodes of the contact surface "
                f"'{name}', and these nodes or the opposite side move, so contact cannot prevent "
                "an overlap there; remove these nodes from the contact surface."
            )
    raise_together(tagged_mesh.mesh.comm, message)


def check_moved_ties(V: fem.FunctionSpace, ties: Constraints, prescribed: Floats) -> None:
    """Refuse supports that move one side of a tie but not the other. Collective.

    Args:
        V: Displacement space.
        ties: The tie rows.
        prescribed: u_D at each local node, shape (num_nodes, gdim).

    Raises:
        InputError: If a support moves only one side of a tie.
    """
    u = fem.Function(V)
    u.x.array[:] = prescribed.ravel()
    apart = float(np.abs(ties.jumps(u.x.petsc_vec)).max(initial=0))
    if V.mesh.comm.allreduce(apart, MPI.MAX) > ROUNDING * _farthest(V, prescribed):
        raise InputError(
            "a support moves nodes of a tied surface, so the other surface would have to follow; "
            "remove these nodes from the support or from the tie, or set value = 0 for the "
            "support."
        )


def _farthest(V: fem.FunctionSpace, prescribed: Floats) -> float:
    """Return the largest component of u_D on all ranks. Collective."""
    own = float(np.abs(prescribed).max(initial=0))
    return float(V.mesh.comm.allreduce(own, MPI.MAX))


@dataclass(frozen=True)
class GivenMotion:
    """Prescribed displacements and gaps at any ζ.

    Attributes:
        displacement: u_D at supports and 0 elsewhere (length): the constant part and the part times
            ζ, shape (2, num_nodes, gdim), at all local nodes including ghosts.
        gap: Gaps of the pairs hosted by this rank (length) after the prescribed motion: the
            constant part and the part times ζ, shape (2, num_pairs).
        slide: Tangential jumps that the prescribed motion alone causes (length): the constant part
            and the part times ζ, shape (2, num_places, gdim − 1). Slip is counted from these jumps.
        sources: Prescribed motion of the opposite side at ζ = 1 (length) for each source of contact
            rows, shape (num_sources, gdim).
        overlap: Prescribed growth of each pair's overlap at ζ = 1 (length), shape (num_pairs,).
        moves_supports: Whether u_D differs from 0 at any ζ.
        driven: Whether ζ moves a support or an obstacle, or increases an overlap.
        parts: The motion that each name in the stages controls, at factor 1; empty without stages.
    """

    displacement: Floats
    gap: Floats
    slide: Floats
    sources: Floats
    overlap: Floats
    moves_supports: bool
    driven: bool
    parts: Mapping[str, "GivenMotion"] = field(default_factory=dict)

    def displacement_at(self, zeta: float) -> Floats:
        """Return u_D (length), shape (num_nodes, gdim)."""
        return np.asarray(self.displacement[0] + zeta * self.displacement[1])

    def gap_at(self, zeta: float) -> Floats:
        """Return the gaps after the prescribed motion (length), shape (num_pairs,)."""
        return np.asarray(self.gap[0] + zeta * self.gap[1])

    def slide_at(self, zeta: float) -> Floats:
        """Return tangential jumps by prescribed motion alone, shape (num_places, gdim − 1)."""
        return np.asarray(self.slide[0] + zeta * self.slide[1])

    def moves(
        self, contacts: Sequence[Contact], obstacles: Sequence[Obstacle]
    ) -> list[tuple[str, Floats]]:
        """Return the name of each contact surface, and the motion of its opposite side at ζ = 1."""
        rest = np.zeros(self.displacement.shape[2])
        of_contacts = [(name, rest) for a in contacts for name in (a.primary, a.secondary)]
        of_obstacles = [(one.on, move_of(one, len(rest))) for one in obstacles]
        return of_contacts + of_obstacles


def given_motion(
    V: fem.FunctionSpace,
    displacement: Floats,
    constraints: Constraints,
    sliding: Constraints,
    friction: Friction,
    sources: Sequence[Source] = (),
) -> GivenMotion:
    """Return the combined prescribed motion of supports, obstacles and overlaps. Collective.

    Args:
        V: Displacement space.
        displacement: See :class:`GivenMotion`.
        constraints: The contact rows.
        sliding: The rows for tangential jumps on surfaces with friction.
        friction: The friction of the problem.
        sources: The sources of the rows, which may move or increase their overlap; by default the
            sources in ``constraints``.

    Raises:
        InputError: If the overlap of a source grows, but no node of this source overlaps.
    """
    comm, gdim = V.mesh.comm, V.mesh.geometry.dim
    sources = sources or constraints.sources
    moves = np.zeros((len(sources), gdim))
    for number, source in enumerate(sources):
        if len(source.move):
            moves[number] = source.move
    of_surface = moves[constraints.surface]
    opened = np.sum(constraints.normal * of_surface, axis=1)
    growing = np.flatnonzero([source.grows for source in sources])
    grow = np.isin(constraints.surface, growing)
    overlap = np.where(grow, np.maximum(-constraints.gap, 0.0), 0.0)
    for i in growing:
        most = float(overlap[constraints.surface == i].max(initial=0))
        if not comm.allreduce(most, MPI.MAX) > 0:
            raise InputError(
                f"the {sources[i].name} has constant = false, but it has no overlap at nodes "
                "that are free to move; give a negative gap, or remove constant."
            )
    gap = np.stack([constraints.gap + overlap, opened - overlap])
    dragged = np.einsum("nij,nj->ni", friction.direction, of_surface[friction.pair])
    slide = np.stack([np.zeros_like(dragged), dragged])
    moved = [comm.allreduce(bool(part.any()), MPI.LOR) for part in displacement]
    if any(moved):
        u = fem.Function(V)
        for i, part in enumerate(displacement):
            u.x.array[:] = part.ravel()
            gap[i] -= constraints.jumps(u.x.petsc_vec)
            slide[i][friction.index >= 0] -= sliding.jumps(u.x.petsc_vec)
    grows = comm.allreduce(bool(overlap.any()), MPI.LOR)
    driven = moved[1] or grows or bool(moves.any())
    return GivenMotion(displacement, gap, slide, moves, overlap, any(moved), driven)
