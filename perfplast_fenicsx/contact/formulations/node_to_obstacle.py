"""Form contact of a surface with a rigid obstacle: a row without a guest for each node."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats, Ints
from perfplast_fenicsx.contact.declared.obstacles import Obstacle
from perfplast_fenicsx.contact.rows.constraints import Constraints, make_constraints
from perfplast_fenicsx.contact.surfaces.node_matching import without_overlap
from perfplast_fenicsx.contact.surfaces.surface_facets import (
    SHARP,
    SurfaceNodes,
    can_host,
    extent,
    surface_nodes,
)
from perfplast_fenicsx.errors import InputError, raise_together
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh


@dataclass(frozen=True)
class NodeToObstacle:
    """The rows u·n ≤ g for each node of a surface, with n and g in the initial position.

    A node that cannot move along n has no row.

    Attributes:
        obstacle: The obstacle.
        place: Location in the case file, for messages.
        number: Number of the obstacle; numbering continues after the contacts.
    """

    obstacle: Obstacle
    place: str
    number: int

    def constraints(
        self, V: fem.FunctionSpace, tagged_mesh: TaggedMesh, fixed: npt.NDArray[np.bool_]
    ) -> Constraints:
        """Return the rows; see :meth:`constraints.Formulation.constraints`.

        Raises:
            InputError: For an unknown name, an obstacle that does not fit the mesh, or an overlap.
        """
        comm, gdim = V.mesh.comm, V.mesh.geometry.dim
        nodes = surface_nodes(V, tagged_mesh, self.obstacle.on, fixed)
        faces = nodes
        nodes = nodes[
            np.unique(nodes["node"], return_index=True)[1]
        ]  # a node on an edge is listed once per face, but has one row
        gap: Floats = np.zeros(len(nodes))
        into: Floats = np.zeros((len(nodes), gdim))
        message: str | None = None
        try:
            gap, into = self.obstacle.towards(nodes["x"][:, :gdim])
        except InputError as error:
            message = f"{self.place}: {error}"
        raise_together(comm, message)
        gap = without_overlap(comm, self.place, gap, extent(comm, nodes["x"]))
        able = can_host(nodes, into)
        nodes, normal = nodes[able], into[able]
        return make_constraints(
            V,
            nodes["node"],
            gap[able],
            normal,
            np.full(len(nodes), self.number, dtype=np.int32),
            [(np.arange(len(nodes)), nodes["number"], normal)],
            area=_towards(faces, nodes["node"], normal),
        )


def _towards(faces: SurfaceNodes, node: Ints, into: Floats) -> Floats:
    """Return the length or area of each node's faces that face the obstacle, shape (n,)."""
    place = np.searchsorted(node, faces["node"])
    place[place == len(node)] = 0
    known = node[place] == faces["node"] if len(node) else np.zeros(len(faces), dtype=np.bool_)
    faces, place = faces[known], place[known]
    looks = np.einsum("ni,ni->n", faces["normal"], into[place]) >= SHARP
    area = np.bincount(place[looks], faces["weight"][looks], len(node))
    return np.asarray(area, dtype=np.float64)
