"""All rows B u = 0: those of ties, of rigid surfaces, and of surfaces along their normal."""

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.contact.formulations.tied_rows import tied_rows
from perfplast_fenicsx.contact.rows.constraints import Constraints, joined
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.problem.assembled.guides import Guides, find_guides
from perfplast_fenicsx.problem.assembled.prescribed_displacement import check_moved_ties
from perfplast_fenicsx.problem.assembled.rigid_rows import rigid_rows
from perfplast_fenicsx.problem.declared.given import Given
from perfplast_fenicsx.profiling import phase


@phase("contact set-up")
def glued_rows(
    V: fem.FunctionSpace,
    tagged_mesh: TaggedMesh,
    given: Given,
    fixed: npt.NDArray[np.bool_],
    displacement: Floats,
) -> tuple[Constraints, Guides, npt.NDArray[np.bool_]]:
    """Make the rows. Collective.

    Args:
        V: Displacement space.
        tagged_mesh: Mesh with names.
        given: What is glued, moves as a rigid body, or is held along its normal.
        fixed: Components held by supports at each local node, shape (num_nodes, gdim).
        displacement: u_D at each local node (length), its constant part and that which ζ
            multiplies, shape (2, num_nodes, gdim).

    Returns:
        The rows, those of guides last; the guides; and the components of local nodes that supports
        hold, ties host, or that follow a rigid surface: contact cannot have them.

    Raises:
        InputError: If names or surfaces do not fit.
    """
    taken = fixed.copy()
    guides, held = find_guides(V, tagged_mesh, given.supports, taken, displacement)
    glued = tied_rows(V, tagged_mesh, given.ties, taken)
    for part in displacement:
        check_moved_ties(V, glued, part)
    for surface in given.rigid if tagged_mesh.axisymmetric else ():
        if not (surface.free and surface.held == "x"):
            raise InputError(
                f"the surface '{surface.on}' is to move as a rigid body, which in axisymmetry it"
                " does along the axis alone; give held = 'x', or instead of it a support with"
                " components = 'y' and a value."
            )
    taken[glued.host, np.argmax(glued.normal, axis=1)] = True
    parts = rigid_rows(V, tagged_mesh, given.rigid, taken)
    return joined(V, [glued, *parts, held]), guides, taken
