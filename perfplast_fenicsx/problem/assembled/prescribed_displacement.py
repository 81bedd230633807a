"""Store the displacement u_D of supports as arrays, and check that contact can see it."""

from collections.abc import Sequence

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
from dolfinx import default_scalar_type, fem, la

from perfplast_fenicsx.arrays import Floats, Ints
from perfplast_fenicsx.contact.rows.constraints import Constraints
from perfplast_fenicsx.contact.rows.rigid_motions import nodes_of
from perfplast_fenicsx.contact.surfaces.surface_facets import LEAST_COSINE, face_nodes
from perfplast_fenicsx.errors import InputError, raise_together
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.parallel import bounding_box
from perfplast_fenicsx.problem.declared.rigid_surface import RigidSurface
from perfplast_fenicsx.problem.declared.supports import AXES, Support
from perfplast_fenicsx.rounding import ROUNDING


def conditions_at_rest(V: fem.FunctionSpace, held: npt.NDArray[np.bool_]) -> list[fem.DirichletBC]:
    """Return conditions of increments: 0 at held components, flags of shape (num_nodes, gdim)."""
    zero, gdim = default_scalar_type(0), held.shape[1]
    nodes = [np.flatnonzero(held[:, i]).astype(np.int32) for i in range(gdim)]
    return [fem.dirichletbc(zero, nodes[i] * gdim + i, V.sub(i)) for i in range(gdim)]


def known_displacements(
    V: fem.FunctionSpace, tagged_mesh: TaggedMesh, supports: Sequence[Support | RigidSurface]
) -> tuple[npt.NDArray[np.bool_], Floats, Ints]:
    """Return which components supports and moved rigid surfaces hold, and their displacements.

    Collective.

    On the axis of bodies of revolution no node moves radially, whatever holds it.

    Returns:
        Flags; displacements (length), the constant part and the part times ζ, 0 at other
        components, shape (2, num_nodes, gdim); and the number of the first support that holds each
        component, −1 at others. All at local nodes including ghosts, shape (num_nodes, gdim).

    Raises:
        InputError: For an unknown surface, wrong components, a value that is not finite, or two
            values for the same component of a node.
    """
    fdim, gdim = tagged_mesh.mesh.topology.dim - 1, tagged_mesh.mesh.geometry.dim
    x = V.tabulate_dof_coordinates()[:, :gdim]
    fixed, values, message = np.zeros(x.shape, dtype=bool), np.zeros((2, *x.shape)), None
    comm = tagged_mesh.mesh.comm
    holder = np.full(x.shape, -1, dtype=np.int32)
    rounding = 1e-12  # displacements that differ by less than this share of the largest are equal
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
            "a support moves nodes of the axis r = 0 along x, which is the radius; remove "
            "x from its components, or the axis from its surface."
        )
    raise_together(comm, message)
    return fixed | on_axis, values, holder


def motion_of(comm: MPI.Intracomm, support: Support | RigidSurface, x: Floats) -> Floats:
    """Return the displacement of points, or raise the same error on all ranks. Collective."""
    found, fault = np.zeros_like(x), None
    try:
        found = support.motion(x)
    except InputError as error:  # a formula may have no value at a point on one rank
        fault = str(error)
    raise_together(comm, fault)
    return found


def _told(displacement: Floats) -> str:
    """Return a displacement in words: its constant part and the part that ζ multiplies."""
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
    """Refuse supports that move nodes of contact surfaces along their normals without any pair.

    There is no pair where neither of its nodes is free along the normal. Collective.

    Args:
        V: Displacement space.
        tagged_mesh: Mesh with names.
        moves: The name of each surface in contact, and the given motion of its opposite side for ζ
            = 1 (length): 0, or the motion of an obstacle, shape (gdim,).
        constraints: The rows of these surfaces.
        fixed: Components held by supports at each local node, shape (num_nodes, gdim).
        prescribed: u_D: the constant part and the part times ζ, shape (2, num_nodes, gdim).

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
                f"supports hold nodes of the contact surface '{name}' along its normal, "
                "but these nodes or the opposite side are moved, so that they cannot give "
                "way; remove these nodes from the contact surface."
            )
    raise_together(tagged_mesh.mesh.comm, message)


def check_moved_ties(V: fem.FunctionSpace, ties: Constraints, prescribed: Floats) -> None:
    """Refuse supports that move one side of a tie but not the other. Collective.

    Args:
        V: Displacement space.
        ties: The rows of the ties.
        prescribed: u_D at each local node, shape (num_nodes, gdim).

    Raises:
        InputError: If a support does.
    """
    u = fem.Function(V)
    u.x.array[:] = prescribed.ravel()
    apart = float(np.abs(ties.jumps(u.x.petsc_vec)).max(initial=0))
    if V.mesh.comm.allreduce(apart, MPI.MAX) > ROUNDING * _farthest(V, prescribed):
        raise InputError(
            "a support moves nodes of a tied surface, which the other surface would have "
            "to follow; remove these nodes from the support or from the tie, or give the "
            "support the value 0."
        )


def _farthest(V: fem.FunctionSpace, prescribed: Floats) -> float:
    """Return the largest component of u_D on any rank. Collective."""
    own = float(np.abs(prescribed).max(initial=0))
    return float(V.mesh.comm.allreduce(own, MPI.MAX))
