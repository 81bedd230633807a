"""Which formulation makes the rows of which contact."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from perfplast_fenicsx.contact.constraints import Constraints, Formulation, joined
from perfplast_fenicsx.contact.contact import Contact
from perfplast_fenicsx.contact.node_to_node import NodeToNode
from perfplast_fenicsx.contact.node_to_obstacle import NodeToObstacle
from perfplast_fenicsx.contact.obstacles import Obstacle
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh


def find_constraints(
    V: fem.FunctionSpace,
    tagged_mesh: TaggedMesh,
    contacts: Sequence[Contact],
    obstacles: Sequence[Obstacle],
    fixed: npt.NDArray[np.bool_],
) -> Constraints:
    """The rows of all contacts and, behind them, of all obstacles. Collective.

    Args:
        V: Displacement space.
        tagged_mesh: Mesh with names.
        contacts: What is in contact.
        obstacles: What does not move.
        fixed: Components held by supports at each local node, shape (num_nodes, gdim).

    Raises:
        InputError: If surfaces do not fit each other or an obstacle.
    """
    chosen: list[Formulation] = []
    for count, contact in enumerate(contacts, start=1):
        place = f"contact {count} ('{contact.primary}', '{contact.secondary}')"
        chosen.append(NodeToNode(contact, place, len(chosen)))
    for count, obstacle in enumerate(obstacles, start=1):
        place = f"obstacle {count} ({type(obstacle).__name__.lower()} at '{obstacle.on}')"
        chosen.append(NodeToObstacle(obstacle, place, len(chosen)))
    return joined(V, [formulation.constraints(V, tagged_mesh, fixed) for formulation in chosen])
