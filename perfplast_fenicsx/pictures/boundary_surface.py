"""The skin of the bodies, put together on rank 0 for a picture.

Each rank extracts the triangles of its own exterior facets; only these travel, never whole fields.
Of a plane mesh the skin is the mesh itself, and its exterior facets are the edges around it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from dolfinx.mesh import exterior_facet_indices

from perfplast_fenicsx.compat import entity_nodes, geometry_dofmap
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh

Ints = npt.NDArray[np.int32]
Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Surface:
    """Triangles with values; points of different ranks are kept apart.

    Attributes:
        points: Undeformed points, shape (num_points, 3).
        triangles: Indices of points, in 3D counterclockwise from outside, shape (num_triangles, 3).
        edges: Exterior edges of a plane mesh as indices of points, from the first to the second
            with the body on the left, shape (num_edges, 2); none in 3D.
        body: Index of each triangle's volume in ``names``, shape (num_triangles,).
        names: Names of the volumes, in the order of their tags.
        at_points: Nodal values by name, shape (num_points,) or (num_points, 3).
        at_cells: Values of the cells below the triangles by name, shape (num_triangles,).
        marks: Whether each of :attr:`facets` is on a marked surface, by name of the mark.
    """

    points: Floats
    triangles: npt.NDArray[np.int64]
    edges: npt.NDArray[np.int64]
    body: npt.NDArray[np.int64]
    names: list[str]
    at_points: dict[str, Floats]
    at_cells: dict[str, Floats]
    marks: dict[str, npt.NDArray[np.bool_]]

    def __repr__(self) -> str:
        return f"Surface({', '.join(self.names)}; {len(self.triangles)} triangles)"

    @property
    def plane(self) -> bool:
        """Whether it is that of a plane mesh."""
        return len(self.edges) > 0

    @property
    def facets(self) -> npt.NDArray[np.int64]:
        """Where loads and contact act: the triangles, of a plane mesh the edges."""
        return self.edges if self.plane else self.triangles

    @property
    def normals(self) -> Floats:
        """Outward normals of the facets, as long as their areas or lengths, shape (n, 3)."""
        return _normals(self.points, self.facets)

    @property
    def areas(self) -> Floats:
        """Of the triangles."""
        return np.asarray(np.linalg.norm(_normals(self.points, self.triangles), axis=1))

    @property
    def size(self) -> float:
        """The diagonal of the box around it."""
        return float(np.linalg.norm(np.ptp(self.points, axis=0)))


def gather_surface(
    assembly: TaggedMesh,
    nodal: Mapping[str, fem.Function],
    cellwise: Mapping[str, fem.Function],
    marks: Mapping[str, Sequence[str]],
) -> Surface | None:
    """The skin of all bodies, on rank 0. Collective.

    Args:
        assembly: Mesh with names.
        nodal: Scalar or vector Lagrange functions of degree 1 or more; vertex values are taken.
        cellwise: Piecewise constant scalars.
        marks: Names of the surfaces with each mark.

    Returns:
        The surface on rank 0, None elsewhere.
    """
    mesh = assembly.mesh
    facets, corners, cells = _exterior(assembly)
    triangles: Ints = corners
    edges: Ints = np.zeros((0, 2), dtype=np.int32)
    if mesh.topology.dim == 2:
        cells = np.arange(mesh.topology.index_map(2).size_local, dtype=np.int32)
        triangles, edges = geometry_dofmap(mesh)[cells, :3], corners
    nodes = np.concatenate([triangles.ravel(), edges.ravel()])
    used, local = np.unique(nodes, return_inverse=True)
    local = local.ravel().astype(np.int64)
    tags = np.zeros(len(geometry_dofmap(mesh)), dtype=np.int64)
    tags[assembly.cell_tags.indices] = assembly.cell_tags.values
    names = sorted(assembly.volumes, key=lambda name: assembly.volumes[name])
    body = np.searchsorted([assembly.volumes[name] for name in names], tags[cells])
    piece = Surface(
        points=mesh.geometry.x[used].astype(np.float64),
        triangles=local[: triangles.size].reshape(-1, 3),
        edges=local[triangles.size :].reshape(-1, 2),
        body=body.astype(np.int64),
        names=names,
        at_points={name: _at_nodes(function)[used] for name, function in nodal.items()},
        at_cells={name: function.x.array[cells] for name, function in cellwise.items()},
        marks={
            mark: np.isin(facets, [facet for name in names for facet in assembly.facets(name)])
            for mark, names in marks.items()
        },
    )
    pieces = mesh.comm.gather(piece)
    return None if pieces is None else _joined(pieces)


def _exterior(assembly: TaggedMesh) -> tuple[Ints, Ints, Ints]:
    """The owned exterior facets: their indices, their vertices' geometry nodes, their cells."""
    mesh = assembly.mesh
    tdim = mesh.topology.dim
    mesh.topology.create_connectivity(tdim - 1, tdim)
    mesh.topology.create_connectivity(tdim, tdim - 1)
    facets = exterior_facet_indices(mesh.topology)
    corners: Ints = entity_nodes(mesh, tdim - 1, facets)[:, :tdim]
    to_cell = mesh.topology.connectivity(tdim - 1, tdim)
    cells = to_cell.array[to_cell.offsets[facets]]
    x: Floats = mesh.geometry.x.astype(np.float64)
    turn_outward(corners, x, x[geometry_dofmap(mesh)[cells, : tdim + 1]].mean(axis=1))
    return facets, corners, cells


def turn_outward(corners: npt.NDArray[Any], x: Floats, centres: Floats) -> None:
    """Order the corners of facets such that their normals point out of their cells.

    Args:
        corners: Indices of points, shape (num_facets, 2 or 3); changed in place.
        x: The points, shape (num_points, 3).
        centres: Of each facet's cell, shape (num_facets, 3).
    """
    from_inside: Floats = x[corners[:, 0]] - centres
    inward = np.einsum("ni,ni->n", _normals(x, corners), from_inside) < 0
    corners[inward, -2:] = corners[inward, :-3:-1]


def _normals(points: Floats, facets: npt.NDArray[np.integer]) -> Floats:
    """On the right of edges, and where triangles are counterclockwise; as long as the area."""
    along = points[facets[:, 1]] - points[facets[:, 0]]
    if facets.shape[1] == 2:
        return np.cross(along, [0.0, 0.0, 1.0])
    return np.cross(along, points[facets[:, 2]] - points[facets[:, 0]]) / 2


def _at_nodes(function: fem.Function) -> Floats:
    """Values at the local geometry nodes that are vertices, else 0; vectors with 3 components."""
    V, mesh = function.function_space, function.function_space.mesh
    vertices = mesh.topology.dim + 1
    size = V.dofmap.index_map_bs
    values = np.zeros((len(mesh.geometry.x), 3 if size > 1 else 1))
    nodes = geometry_dofmap(mesh)[:, :vertices].ravel()
    dofs = V.dofmap.list[:, :vertices].ravel()
    values[nodes, :size] = function.x.array.reshape(-1, size)[dofs]
    return values if size > 1 else values[:, 0]


def _joined(pieces: list[Surface]) -> Surface:
    offsets = np.cumsum([0] + [len(piece.points) for piece in pieces])

    def shifted(part: str) -> npt.NDArray[np.int64]:
        places = zip(pieces, offsets, strict=False)
        return np.concatenate([getattr(piece, part) + offset for piece, offset in places])

    together = {
        part: {
            name: np.concatenate([getattr(piece, part)[name] for piece in pieces])
            for name in getattr(pieces[0], part)
        }
        for part in ("at_points", "at_cells", "marks")
    }
    return Surface(
        points=np.concatenate([piece.points for piece in pieces]),
        triangles=shifted("triangles"),
        edges=shifted("edges"),
        body=np.concatenate([piece.body for piece in pieces]),
        names=pieces[0].names,
        **together,
    )
