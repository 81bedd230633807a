"""The displacement u_D of supports as arrays, and where contact could not see it."""

from collections.abc import Sequence

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
from dolfinx import default_scalar_type, fem, la

from perfplast_fenicsx.arrays import Floats, Ints
from perfplast_fenicsx.contact.rows.constraints import Constraints
from perfplast_fenicsx.contact.rows.rigid_motions import nodes_of
from perfplast_fenicsx.contact.surfaces.surface_nodes import LEAST_COSINE
from perfplast_fenicsx.contact.surfaces.surface_normals import face_nodes
from perfplast_fenicsx.errors import InputError, raise_together
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.parallel import bounding_box
from perfplast_fenicsx.problem.declared.rigid_surface import RigidSurface
from perfplast_fenicsx.problem.declared.supports import AXES, Support
from perfplast_fenicsx.rounding import ROUNDING


def conditions_at_rest(V: fem.FunctionSpace, held: npt.NDArray[np.bool_]) -> list[fem.DirichletBC]:
    """The conditions of increments: 0 at held components, flags of shape (num_nodes, gdim)."""
    zero, gdim = default_scalar_type(0), held.shape[1]
    nodes = [np.flatnonzero(held[:, i]).astype(np.int32) for i in range(gdim)]
    return [fem.dirichletbc(zero, nodes[i] * gdim + i, V.sub(i)) for i in range(gdim)]


def known_displacements(
    V: fem.FunctionSpace, tagged_mesh: TaggedMesh, supports: Sequence[Support | RigidSurface]
) -> tuple[npt.NDArray[np.bool_], Floats, Ints]:
    """Which components supports and rigid surfaces that are moved hold, and where. Collective.

    On the axis of bodies of revolution nothing moves outwards, whatever holds it.

    Returns:
        Flags; displacements (length), the constant ones and those that ζ multiplies, 0 at other
        components, shape (2, num_nodes, gdim); and the number of the first support that holds them,
        −1 at others. All of local nodes, ghosts too, shape (num_nodes, gdim).

    Raises:
        InputError: An unknown surface, wrong components, a value that is not finite, or two values
            for the same component of a node.
    """
    fdim, gdim = tagged_mesh.mesh.topology.dim - 1, tagged_mesh.mesh.geometry.dim
    x = V.tabulate_dof_coordinates()[:, :gdim]
    fixed, values, message = np.zeros(x.shape, dtype=bool), np.zeros((2, *x.shape)), None
    comm = tagged_mesh.mesh.comm
    holder = np.full(x.shape, -1, dtype=np.int32)
    rounding = 1e-12  # displacements that differ by this share of the largest are one
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
                    f"the support on '{support.on}' moves nodes by {_told(new[:, first])} along"
                    f" {AXES[axis]} that another support moves by {_told(old[:, first])}; leave the"
                    " component out of one of them, or part their surfaces."
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
            "a support moves nodes of the axis r = 0 along x, which is the radius; leave x out of"
            " its components, or the axis out of its surface."
        )
    raise_together(comm, message)
    return fixed | on_axis, values, holder


def motion_of(comm: MPI.Intracomm, support: Support | RigidSurface, x: Floats) -> Floats:
    """Return the displacement of points, or refuse it on all ranks. Collective."""
    found, fault = np.zeros_like(x), None
    try:
        found = support.motion(x)
    except InputError as error:  # a formula may have no value at a point of one rank
        fault = str(error)
    raise_together(comm, fault)
    return found


def _told(displacement: Floats) -> str:
    """Return a displacement in words: its constant part, and that which ζ multiplies."""
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
    """Refuse what moves nodes of contact surfaces along their normals, unseen by any pair.

    Where neither node of a pair is free along the normal there is no pair. Collective.

    Args:
        V: Displacement space.
        tagged_mesh: Mesh with names.
        moves: The name of each surface in contact, and how far what is opposite moves by itself for
            ζ = 1 (length): 0, or as an obstacle does, shape (gdim,).
        constraints: The rows of these surfaces.
        fixed: Components held by supports at each local node, shape (num_nodes, gdim).
        prescribed: u_D, constant and times ζ, shape (2, num_nodes, gdim).

    Raises:
        InputError: Naming the surface.
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
                f"supports hold nodes of the contact surface '{name}' along its normal, so that"
                " these, which move or are moved against, cannot give way; leave them out of the"
                " contact surface."
            )
    raise_together(tagged_mesh.mesh.comm, message)


def check_moved_ties(V: fem.FunctionSpace, ties: Constraints, prescribed: Floats) -> None:
    """Refuse supports that by themselves move one side of a tie and not the other. Collective.

    Args:
        V: Displacement space.
        ties: Their rows.
        prescribed: u_D at each local node, shape (num_nodes, gdim).

    Raises:
        InputError: If they do.
    """
    u = fem.Function(V)
    u.x.array[:] = prescribed.ravel()
    apart = float(np.abs(ties.jumps(u.x.petsc_vec)).max(initial=0))
    if V.mesh.comm.allreduce(apart, MPI.MAX) > ROUNDING * _farthest(V, prescribed):
        raise InputError(
            "a support moves nodes of a tied surface, which the other surface would have to"
            " follow; leave these nodes out of the support or of the tie, or give it the value 0."
        )


def _farthest(V: fem.FunctionSpace, prescribed: Floats) -> float:
    """Return the largest component of u_D on any rank. Collective."""
    own = float(np.abs(prescribed).max(initial=0))
    return float(V.mesh.comm.allreduce(own, MPI.MAX))
