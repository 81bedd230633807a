"""The displacement u_D of supports as arrays, and where contact could not see it."""

from collections.abc import Iterable, Sequence

import numpy as np
import numpy.typing as npt
from dolfinx import fem, la

from perfplast_fenicsx.arrays import Floats, Ints
from perfplast_fenicsx.contact.constraints import Constraints
from perfplast_fenicsx.contact.rigid_motions import nodes_of
from perfplast_fenicsx.contact.surface_nodes import LEAST_COSINE
from perfplast_fenicsx.contact.surface_normals import face_nodes
from perfplast_fenicsx.errors import InputError, raise_together
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.problem.supports import AXES, Support

ROUNDING = 1e-9
"""Movements along a normal below this share of u_D count as none."""


def known_displacements(
    V: fem.FunctionSpace, tagged_mesh: TaggedMesh, supports: Sequence[Support]
) -> tuple[npt.NDArray[np.bool_], Floats, Ints]:
    """Which components the supports hold, and where. Collective.

    Returns:
        Flags, displacements (length) that are 0 at other components, and the number of the first
        support that holds them, −1 at others; all of local nodes, ghosts too, shape
        (num_nodes, gdim).

    Raises:
        InputError: An unknown surface, wrong components, a value that is not finite, or two values
            for the same component of a node.
    """
    fdim, gdim = tagged_mesh.mesh.topology.dim - 1, tagged_mesh.mesh.geometry.dim
    index_map = V.dofmap.index_map
    shape = (index_map.size_local + index_map.num_ghosts, gdim)
    fixed, values, message = np.zeros(shape, dtype=bool), np.zeros(shape), None
    holder = np.full(shape, -1, dtype=np.int32)
    for number, support in enumerate(supports):
        if not np.isfinite(support.value):
            raise InputError(
                f"value = {support.value} of the support on '{support.on}' is not finite; give a"
                " length, or 0 for none."
            )
        nodes = fem.locate_dofs_topological(V, fdim, tagged_mesh.facets(support.on))
        for axis in support.axes(gdim):
            known = nodes[fixed[nodes, axis]]
            other = values[known, axis][values[known, axis] != support.value]
            if other.size:
                message = (
                    f"the support on '{support.on}' moves nodes by {support.value:g} along"
                    f" {AXES[axis]} that another support moves by {other[0]:g}; leave the component"
                    " out of one of them, or part their surfaces."
                )
            fresh = nodes[~fixed[nodes, axis]]
            holder[fresh, axis] = number
            fixed[nodes, axis] = True
            values[nodes, axis] = support.value
    raise_together(tagged_mesh.mesh.comm, message)
    return fixed, values, holder


def check_moved_surfaces(
    V: fem.FunctionSpace,
    tagged_mesh: TaggedMesh,
    surfaces: Iterable[str],
    constraints: Constraints,
    fixed: npt.NDArray[np.bool_],
    prescribed: Floats,
) -> None:
    """Refuse supports that move nodes of contact surfaces along their normals, unseen by any pair.

    Where neither node of a pair is free along the normal there is no pair. Collective.

    Args:
        V: Displacement space.
        tagged_mesh: Mesh with names.
        surfaces: Names of those in contact, with each other or with obstacles.
        constraints: The rows of these surfaces.
        fixed: Components held by supports at each local node, shape (num_nodes, gdim).
        prescribed: u_D, same shape.

    Raises:
        InputError: Naming the surface.
    """
    message = None
    paired = la.vector(V.dofmap.index_map, 1)
    paired.array[nodes_of(constraints.B, V.dofmap.index_map_bs)] = 1
    paired.scatter_forward()
    for name in surfaces:
        faces = face_nodes(V, tagged_mesh, name)
        along = np.abs(np.sum(faces.normal * prescribed[faces.node], axis=1))
        freedom = (np.abs(faces.normal) * ~fixed[faces.node]).max(axis=1, initial=0)
        unseen = (freedom < LEAST_COSINE) & (paired.array[faces.node] == 0)
        if (unseen & (along > ROUNDING * np.abs(prescribed).max(initial=0))).any():
            message = (
                f"supports move nodes of the contact surface '{name}' along its normal towards"
                " others that cannot give way; leave these nodes out of the contact surface."
            )
    raise_together(tagged_mesh.mesh.comm, message)


def closed_gaps(V: fem.FunctionSpace, constraints: Constraints, prescribed: Floats) -> Floats:
    """What u_D closes of the gap of each pair hosted here (length). Collective."""
    u = fem.Function(V)
    u.x.array[:] = prescribed.ravel()
    return constraints.jumps(u.x.petsc_vec)
