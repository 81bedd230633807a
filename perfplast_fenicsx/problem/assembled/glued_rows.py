"""Assemble all rows B u = 0: of ties, rigid bodies and surfaces, and supports along a normal."""

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
from perfplast_fenicsx.problem.assembled.rigid_bodies import RigidBodies, check_touching
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
    bodies: RigidBodies | None = None,
) -> tuple[Constraints, Guides, npt.NDArray[np.bool_]]:
    """Return the rows, the guides and the components that contact cannot use. Collective.

    Args:
        V: Displacement space.
        tagged_mesh: Mesh with names.
        given: The declaration: ties, rigid surfaces, and supports along a normal.
        fixed: Components held by supports at each local node, shape (num_nodes, gdim).
        displacement: u_D at each local node (length): the constant part and the part times ζ, shape
            (2, num_nodes, gdim).
        bodies: Rigid bodies, whose nodes host no other rows.

    Returns:
        The rows, with those of guides last. The guides. The components of local nodes that contact
        cannot use: those that supports hold, ties host, or rigid surfaces prescribe.

    Raises:
        InputError: If names or surfaces do not fit.
    """
    taken, solid = fixed.copy(), list[Constraints]()
    if bodies is not None:
        check_touching(V, tagged_mesh, given, bodies)
        taken[bodies.of_node >= 0] = True
        solid = bodies.rows
        for part in displacement:
            for rows in solid:
                check_moved_ties(V, rows, part)
    guides, held = find_guides(V, tagged_mesh, given.supports, taken, displacement)
    glued = tied_rows(V, tagged_mesh, given.ties, taken)
    for part in displacement:
        check_moved_ties(V, glued, part)
    for surface in given.rigid if tagged_mesh.axisymmetric else ():
        if not (surface.free and surface.held == "x"):
            raise InputError(
                f"the rigid surface '{surface.on}' can move only along the axis in "
                "axisymmetry; give held = 'x', or replace it by a support with components "
                "= 'y' and a value."
            )
    taken[glued.host, np.argmax(glued.normal, axis=1)] = True
    parts = rigid_rows(V, tagged_mesh, given.rigid, taken)
    return joined(V, [*solid, glued, *parts, held]), guides, taken
