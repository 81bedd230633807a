"""Collect nodes of a surface with their contact data, as rows that travel between ranks."""

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.contact.surfaces.surface_normals import FaceNodes, face_nodes
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.parallel import bounding_box

LEAST_COSINE = 0.1
"""Smallest |n_i| for which the normal jump may replace component i of the host: smaller pivots make
the change of basis T ill-conditioned."""

SurfaceNodes = npt.NDArray[np.void]
"""Rows of :func:`surface_node_type`; a node on an edge has one row for each face of the surface."""


def surface_node_type(gdim: int) -> np.dtype:
    """Return the structured type of a node.

    Its fields are the coordinates ``x`` (3 numbers), the ``rank`` that owns the node, its local
    block dof ``node`` on that rank and its global number ``number``. Further fields are the
    ``size`` of the facets around it (length), the ``weight`` ∫N of its shape function over the face
    (length, area) and the outward unit ``normal`` of the face. ``free`` marks the components that
    no support holds. ``taken`` is Σ m mᵀ of the directions m for which rows of other contacts have
    used the node as their host.
    """
    return np.dtype(
        [
            ("x", np.float64, 3),
            ("rank", np.int32),
            ("node", np.int32),
            ("number", np.int64),
            ("size", np.float64),
            ("weight", np.float64),
            ("normal", np.float64, gdim),
            ("free", np.bool_, gdim),
            ("taken", np.float64, (gdim, gdim)),
        ]
    )


def surface_nodes(
    V: fem.FunctionSpace, tagged_mesh: TaggedMesh, surface: str, fixed: npt.NDArray[np.bool_]
) -> SurfaceNodes:
    """Return rows of a surface's owned nodes. Collective.

    Args:
        V: Displacement space.
        tagged_mesh: Mesh with names.
        surface: Name of the surface.
        fixed: Components held by supports at each local node, shape (num_nodes, gdim).
    """
    return rows_of_nodes(V, face_nodes(V, tagged_mesh, surface), fixed)


def rows_of_nodes(
    V: fem.FunctionSpace, faces: FaceNodes, fixed: npt.NDArray[np.bool_]
) -> SurfaceNodes:
    """Return rows of nodes whose faces are known. Not collective."""
    rows = np.empty(len(faces.node), dtype=surface_node_type(V.mesh.geometry.dim))
    rows["x"] = V.tabulate_dof_coordinates()[faces.node]
    rows["rank"] = V.mesh.comm.rank
    rows["node"] = faces.node
    rows["number"] = V.dofmap.index_map.local_to_global(faces.node)
    rows["size"] = faces.size
    rows["weight"] = faces.weight
    rows["normal"] = faces.normal
    rows["free"] = ~fixed[faces.node]
    rows["taken"] = 0
    return rows


def check_outside(comm: MPI.Intracomm, place: str, surface: str, nodes: SurfaceNodes) -> None:
    """Refuse a surface that is nowhere on the outside of a body. Collective.

    Raises:
        InputError: If the surface has no nodes.
    """
    if not comm.allreduce(len(nodes)):
        raise InputError(
            f"{place}: '{surface}' has no facet on the outside of a body; name surfaces of "
            "bodies that share no nodes (write_split separates them)."
        )


def can_host(nodes: SurfaceNodes, normal: Floats) -> npt.NDArray[np.bool_]:
    """Return whether supports leave nodes enough freedom along normals to host the jump.

    Args:
        nodes: Nodes, shape (n,).
        normal: Normals, shape (n, gdim).
    """
    able: npt.NDArray[np.bool_] = (np.abs(normal) * nodes["free"]).max(axis=1, initial=0) >= (
        LEAST_COSINE
    )
    return able


def directions(normal: Floats, free: npt.NDArray[np.bool_]) -> Floats:
    """Return the unit vectors of the free parts of normals, shape (n, gdim); 0 for none.

    Args:
        normal: Normals, shape (n, gdim).
        free: Components that no support holds, shape (n, gdim).
    """
    left = normal * free
    length = np.linalg.norm(left, axis=1, keepdims=True)
    return np.divide(left, length, out=np.zeros_like(left), where=length > 0)


def crowded(nodes: SurfaceNodes, normal: Floats) -> Floats:
    """Return Σ (m·n)² over the directions m that hosts have given away: 0 if n is normal to all.

    Args:
        nodes: Nodes, shape (n,).
        normal: Next direction, shape (n, gdim).
    """
    along = directions(normal, nodes["free"])
    shares: Floats = np.einsum("ni,nij,nj->n", along, nodes["taken"], along)
    return shares


def extent(comm: MPI.Intracomm, x: Floats) -> float:
    """Return the diagonal of the box around points of all ranks (length). Collective."""
    low, high = bounding_box(comm, x)
    return float(np.linalg.norm(high - low))
