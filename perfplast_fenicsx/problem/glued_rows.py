"""All rows B u = 0: those of ties, and those of rigid surfaces."""

from collections.abc import Sequence

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from perfplast_fenicsx.contact.constraints import Constraints, joined
from perfplast_fenicsx.contact.tie import Tie
from perfplast_fenicsx.contact.tied_rows import tied_rows
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.problem.rigid_rows import rigid_rows
from perfplast_fenicsx.problem.rigid_surface import RigidSurface
from perfplast_fenicsx.profiling import phase


@phase("contact set-up")
def glued_rows(
    V: fem.FunctionSpace,
    tagged_mesh: TaggedMesh,
    ties: Sequence[Tie],
    rigid: Sequence[RigidSurface],
    fixed: npt.NDArray[np.bool_],
    moved: bool,
) -> tuple[Constraints, npt.NDArray[np.bool_]]:
    """Make the rows. Collective.

    Args:
        V: Displacement space.
        tagged_mesh: Mesh with names.
        ties: What is glued.
        rigid: Surfaces that move as rigid bodies.
        fixed: Components held by supports at each local node, shape (num_nodes, gdim).
        moved: Whether supports move nodes of this rank.

    Returns:
        The rows; and the components of local nodes that supports hold, ties host, or that follow a
        rigid surface: contact cannot have them.

    Raises:
        InputError: If names or surfaces do not fit.
    """
    glued = tied_rows(V, tagged_mesh, ties, fixed)
    comm = V.mesh.comm
    if comm.allreduce(len(glued.host)) and comm.allreduce(moved, MPI.LOR):
        raise InputError(
            "ties and supports that move do not go together; leave the values of the supports"
            " or the ties out."
        )
    taken = fixed.copy()
    taken[glued.host, np.argmax(glued.normal, axis=1)] = True
    parts = rigid_rows(V, tagged_mesh, rigid, taken)
    return joined(V, [glued, *parts]), taken
