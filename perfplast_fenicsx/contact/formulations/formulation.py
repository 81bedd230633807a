"""Choose the formulation for each contact, and form the rows of all contacts and obstacles."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.contact.declared.contact import Contact
from perfplast_fenicsx.contact.declared.obstacles import Obstacle, move_of
from perfplast_fenicsx.contact.formulations.node_to_node import NodeToNode
from perfplast_fenicsx.contact.formulations.node_to_obstacle import NodeToObstacle
from perfplast_fenicsx.contact.mortar.mortar_contact import Mortar
from perfplast_fenicsx.contact.rows.constraints import Constraints, Formulation, Source, joined
from perfplast_fenicsx.contact.surfaces.node_matching import NoPartners
from perfplast_fenicsx.contact.surfaces.surface_facets import directions
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh


@dataclass(frozen=True)
class NodesOrMortar:
    """Contact by pairs of nodes if the nodes of the surfaces match, and mortar contact if not.

    Attributes:
        contact: The two surfaces.
        place: Location in the case file, for messages.
        number: Number of the contact among the contacts and obstacles.
        taken: Directions at each local node that other rows already use, see
            :func:`surface_facets.surface_node_type`; None if there are none.
    """

    contact: Contact
    place: str
    number: int
    taken: Floats | None = None

    def constraints(
        self, V: fem.FunctionSpace, tagged_mesh: TaggedMesh, fixed: npt.NDArray[np.bool_]
    ) -> Constraints:
        """Return the rows; see :meth:`constraints.Formulation.constraints`."""
        named = (self.contact, self.place, self.number)
        try:
            return NodeToNode(*named, self.taken).constraints(V, tagged_mesh, fixed)
        except NoPartners:
            return Mortar(*named).constraints(V, tagged_mesh, fixed)


FORMULATIONS: dict[str | None, Callable[[Contact, str, int], Formulation]] = {
    None: NodesOrMortar,
    "nodes": NodeToNode,
    "mortar": Mortar,
}
"""Formulations by the value of ``formulation`` in a contact."""


def find_constraints(
    V: fem.FunctionSpace,
    tagged_mesh: TaggedMesh,
    contacts: Sequence[Contact],
    obstacles: Sequence[Obstacle],
    fixed: npt.NDArray[np.bool_],
    solid: npt.NDArray[np.bool_] | None = None,
) -> Constraints:
    """Return the rows of all contacts, followed by the rows of all obstacles. Collective.

    Args:
        V: Displacement space.
        tagged_mesh: Mesh with named bodies and surfaces.
        contacts: The contacts.
        obstacles: The obstacles.
        fixed: Components at each local node that supports hold, shape (num_nodes, gdim).
        solid: Nodes of rigid bodies, which cannot be hosts although they can move, shape
            (num_nodes,); None if there are none.

    Raises:
        errors.InputError: If two surfaces, or a surface and an obstacle, do not fit each other.
    """
    chosen: list[Formulation] = []
    sources = [_of_contact(contact) for contact in contacts]
    sources += [_of_obstacle(obstacle, V.mesh.geometry.dim) for obstacle in obstacles]
    for count, contact in enumerate(contacts, start=1):
        place = f"contact {count} ('{contact.primary}', '{contact.secondary}')"
        chosen.append(FORMULATIONS[contact.formulation](contact, place, len(chosen)))
    for count, obstacle in enumerate(obstacles, start=1):
        place = f"obstacle {count} ({type(obstacle).__name__.lower()} at '{obstacle.on}')"
        chosen.append(NodeToObstacle(obstacle, place, len(chosen)))
    taken = np.zeros((*fixed.shape, fixed.shape[1]))
    if solid is not None:
        taken[solid] = np.eye(fixed.shape[1])
    parts: dict[int, Constraints] = {}
    # If supports hold one side, the other side must be the host. Contacts with held nodes form
    # their rows first; among the others the order of the input applies.
    held = [_is_held(V, tagged_mesh, contact, fixed) for contact in contacts]
    held += [True] * len(obstacles)
    for number in sorted(range(len(chosen)), key=lambda number: not held[number]):
        formulation = chosen[number]
        if isinstance(formulation, NodeToNode | NodesOrMortar):
            formulation = replace(formulation, taken=taken)
        parts[number] = part = formulation.constraints(V, tagged_mesh, fixed)
        along = directions(part.normal, ~fixed[part.host])
        np.add.at(taken, part.host, along[:, :, None] * along[:, None, :])
    return joined(V, [parts[number] for number in range(len(chosen))], sources)


def _is_held(
    V: fem.FunctionSpace, tagged_mesh: TaggedMesh, contact: Contact, fixed: npt.NDArray[np.bool_]
) -> bool:
    """Return whether supports hold any component of a node of ``contact``. Collective."""
    names = [name for name in (contact.primary, contact.secondary) if name in tagged_mesh.surfaces]
    facets = np.concatenate([np.zeros(0, np.int32), *map(tagged_mesh.facets, names)])
    nodes = fem.locate_dofs_topological(V, V.mesh.topology.dim - 1, np.unique(facets))
    return bool(V.mesh.comm.allreduce(bool(fixed[nodes].any()), MPI.LOR))


def _of_contact(contact: Contact) -> Source:
    return Source(
        contact.label,
        contact.secondary,
        contact.name or contact.on,
        contact.tresca,
        contact.coulomb,
        grows=not contact.constant,
        inner=True,
    )


def _of_obstacle(obstacle: Obstacle, gdim: int) -> Source:
    called = obstacle.name or obstacle.on
    move = [float(part) for part in move_of(obstacle, gdim)]
    return Source(
        f"obstacle {called}", obstacle.on, called, obstacle.tresca, obstacle.coulomb, move
    )
