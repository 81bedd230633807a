"""The skin of the bodies, put together on rank 0 for a picture.

Each rank extracts the triangles of its own exterior facets; only these travel, never whole fields.
Of a plane mesh the skin is the mesh itself.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from dolfinx.mesh import entities_to_geometry, exterior_facet_indices

from perfplast_fenicsx.assembly import Assembly
from perfplast_fenicsx.compat import geometry_dofmap

Ints = npt.NDArray[np.int32]
Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Surface:
    """Triangles with values; points of different ranks are kept apart.

    Attributes:
        points: Undeformed points, shape (num_points, 3).
        triangles: Indices of points, counterclockwise from outside, shape (num_triangles, 3).
        body: Index of each triangle's volume in ``names``, shape (num_triangles,).
        names: Names of the volumes, in the order of their tags.
        at_points: Nodal values by name, shape (num_points,) or (num_points, 3).
        at_cells: Values of the cells below the triangles by name, shape (num_triangles,).
        marks: Whether each triangle is on a marked surface, by name of the mark. All False in 2D.
    """

    points: Floats
    triangles: npt.NDArray[np.int64]
    body: npt.NDArray[np.int64]
    names: list[str]
    at_points: dict[str, Floats]
    at_cells: dict[str, Floats]
    marks: dict[str, npt.NDArray[np.bool_]]


def gather_surface(
    assembly: Assembly,
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
    facets, corners, cells = _triangles(assembly)
    dofmap = geometry_dofmap(mesh)
    used, local = np.unique(corners, return_inverse=True)
    tags = np.zeros(len(dofmap), dtype=np.int64)
    tags[assembly.cell_tags.indices] = assembly.cell_tags.values
    names = sorted(assembly.volumes, key=lambda name: assembly.volumes[name])
    body = np.searchsorted([assembly.volumes[name] for name in names], tags[cells])
    piece = Surface(
        points=mesh.geometry.x[used].astype(np.float64),
        triangles=local.reshape(corners.shape).astype(np.int64),
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


def _triangles(assembly: Assembly) -> tuple[Ints, Ints, Ints]:
    """The owned triangles of the skin, outward: facets (−1 in 2D), geometry nodes, cells."""
    mesh = assembly.mesh
    tdim = mesh.topology.dim
    if tdim == 2:
        owned = mesh.topology.index_map(tdim).size_local
        cells = np.arange(owned, dtype=np.int32)
        return np.full_like(cells, -1), geometry_dofmap(mesh)[:owned, :3], cells
    mesh.topology.create_connectivity(tdim - 1, tdim)
    mesh.topology.create_connectivity(tdim, tdim - 1)
    facets = exterior_facet_indices(mesh.topology)
    corners = entities_to_geometry(mesh, tdim - 1, facets)[:, :3]
    to_cell = mesh.topology.connectivity(tdim - 1, tdim)
    cells = to_cell.array[to_cell.offsets[facets]]
    x, cell_nodes = mesh.geometry.x, geometry_dofmap(mesh)[cells, :4]
    a, b, c = (x[corners[:, i]] for i in range(3))
    inward = np.einsum("ni,ni->n", np.cross(b - a, c - a), a - x[cell_nodes].mean(axis=1)) < 0
    corners[inward] = corners[inward][:, [0, 2, 1]]
    return facets, corners, cells


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
    shifted = [piece.triangles + offset for piece, offset in zip(pieces, offsets, strict=False)]
    together = {
        part: {
            name: np.concatenate([getattr(piece, part)[name] for piece in pieces])
            for name in getattr(pieces[0], part)
        }
        for part in ("at_points", "at_cells", "marks")
    }
    return Surface(
        points=np.concatenate([piece.points for piece in pieces]),
        triangles=np.concatenate(shifted),
        body=np.concatenate([piece.body for piece in pieces]),
        names=pieces[0].names,
        **together,
    )
