"""Collect facets of a surface as rows that travel between ranks, and their straight pieces."""

from dataclasses import dataclass

import basix
import numpy as np
import numpy.typing as npt
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.contact.surfaces.surface_nodes import SurfaceNodes, rows_of_nodes
from perfplast_fenicsx.contact.surfaces.surface_normals import faces_of, surface_facets
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh

Facets = npt.NDArray[np.void]
"""Rows of :func:`facet_type`."""

STRAIGHT = 1e-12
"""A facet is straight if its midsides deviate from the middle by at most this share of its size."""

EDGES = {2: ((0, 1),), 3: ((1, 2), (0, 2), (0, 1))}
"""Vertices at the ends of each edge of a facet, in the order of its midsides."""

_SPLIT = {
    2: ((0, 2), (2, 1)),
    3: ((0, 5, 4), (5, 1, 3), (4, 3, 2), (3, 4, 5)),
}
"""Points of the pieces of a curved facet of second order, by dimension of space."""


def facet_type(gdim: int, nodes: int, points: int) -> np.dtype:
    """Return the structured type of a facet.

    Its fields are the coordinates ``x`` of its geometry points. For its nodes they are the
    coordinates ``at``, the outward unit ``normal`` of the face, the global block dof ``node``, the
    ``rank`` that owns it and its ``place`` (index) in that rank's rows of the surface.
    """
    return np.dtype(
        [
            ("x", np.float64, (points, gdim)),
            ("at", np.float64, (nodes, gdim)),
            ("normal", np.float64, (nodes, gdim)),
            ("node", np.int64, nodes),
            ("rank", np.int32, nodes),
            ("place", np.int64, nodes),
        ]
    )


def nodes_and_facets(
    V: fem.FunctionSpace, tagged_mesh: TaggedMesh, surface: str, fixed: npt.NDArray[np.bool_]
) -> tuple[SurfaceNodes, Facets]:
    """Return rows of a surface's owned nodes, and of the facets on this rank. Collective.

    Args:
        V: Displacement space.
        tagged_mesh: Mesh with names.
        surface: Name of the surface.
        fixed: Components held by supports at each local node, shape (num_nodes, gdim).
    """
    found = surface_facets(V, tagged_mesh, surface)
    faces, numbers = faces_of(V, found)
    gdim = V.mesh.geometry.dim
    count, each = found.nodes.shape
    facets = np.empty(count, dtype=facet_type(gdim, each, found.x.shape[1]))
    facets["x"] = found.x
    facets["at"] = V.tabulate_dof_coordinates()[found.nodes][:, :, :gdim]
    facets["normal"] = numbers.normal
    flat = V.dofmap.index_map.local_to_global(found.nodes.ravel())
    facets["node"] = flat.reshape(found.nodes.shape)
    facets["rank"], facets["place"] = numbers.rank, numbers.place
    return rows_of_nodes(V, faces, fixed), facets


def shape_functions(gdim: int, count: int, points: Floats, derivatives: int = 0) -> Floats:
    """Return Lagrange functions of facets at points.

    Args:
        gdim: Dimension of space.
        count: Number of functions of a facet, which determines their degree.
        points: Reference coordinates, shape (..., gdim − 1).
        derivatives: 1 for the first derivatives, 0 for values.

    Returns:
        Values, shape (..., count), or derivatives, shape (gdim − 1, ..., count).
    """
    shape = (*points.shape[:-1], count)
    if not points.size:  # basix would end the process for this input
        return np.zeros((gdim - 1, *shape) if derivatives else shape)
    kind = basix.CellType.interval if gdim == 2 else basix.CellType.triangle
    variant = basix.LagrangeVariant.equispaced
    element = basix.create_element(basix.ElementFamily.P, kind, 1 if count == gdim else 2, variant)
    table = np.asarray(element.tabulate(derivatives, points.reshape(-1, gdim - 1)))[..., 0]
    return table[1:].reshape(gdim - 1, *shape) if derivatives else table[0].reshape(shape)


@dataclass(frozen=True)
class Pieces:
    """Straight simplices that approximate facets: 1 for a straight facet, 2 or 4 for a curved one.

    Attributes:
        facet: Number of the facet, shape (n,).
        x: Corners, shape (n, gdim, gdim).
        at: Reference coordinates of the corners in the facet, shape (n, gdim, gdim − 1).
        centre: Centre of the piece, shape (n, gdim).
        radius: Distance of the farthest corner from the centre, shape (n,).
        normal: Outward unit normal, shape (n, gdim).
        measure: Length or area, shape (n,).
        part: Length or area of the piece in the reference facet, shape (n,).
        curved: Whether the facet is curved, shape (n,).
    """

    facet: Longs
    x: Floats
    at: Floats
    centre: Floats
    radius: Floats
    normal: Floats
    measure: Floats
    part: Floats
    curved: npt.NDArray[np.bool_]


def pieces_of(facets: Facets) -> Pieces:
    """Return the pieces of facets."""
    x = facets["x"]
    count, points, gdim = x.shape
    ends = np.eye(gdim)[:, 1:]
    if points == gdim:
        at = np.broadcast_to(ends, (count, *ends.shape))
        return _pieces(facets, np.arange(count), x, at, np.zeros(count, dtype=np.bool_))
    size = np.abs(x - x.mean(axis=1, keepdims=True)).max(axis=(1, 2))
    edges = EDGES[gdim]
    straight = np.stack([(x[:, i] + x[:, j]) / 2 for i, j in edges], axis=1)
    off = np.abs(x[:, gdim:] - straight).max(axis=(1, 2))
    curved = off > STRAIGHT * size
    at = np.concatenate([ends, [(ends[i] + ends[j]) / 2 for i, j in edges]])
    split = np.array(_SPLIT[gdim])
    plain, bent = np.flatnonzero(~curved), np.flatnonzero(curved)
    return _pieces(
        facets,
        np.concatenate([plain, np.repeat(bent, len(split))]),
        np.concatenate([x[plain][:, :gdim], x[bent][:, split].reshape(-1, gdim, gdim)]),
        np.concatenate(
            [
                np.broadcast_to(ends, (len(plain), *ends.shape)),
                np.broadcast_to(at[split], (len(bent), *at[split].shape)).reshape(-1, *ends.shape),
            ]
        ),
        np.repeat([False, True], [len(plain), len(split) * len(bent)]),
    )


def _pieces(
    facets: Facets, facet: Longs, x: Floats, at: Floats, curved: npt.NDArray[np.bool_]
) -> Pieces:
    gdim = x.shape[2]
    if gdim == 2:
        along = x[:, 1] - x[:, 0]
        normal = np.stack([along[:, 1], -along[:, 0]], axis=1)
    else:
        normal = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]) / 2
    measure = np.linalg.norm(normal, axis=1)
    normal = normal / measure[:, None]
    outward = np.einsum("ni,ni->n", normal, facets["normal"].mean(axis=1)[facet])
    normal = normal * np.where(outward < 0, -1.0, 1.0)[:, None]
    centre = x.mean(axis=1)
    radius = np.linalg.norm(x - centre[:, None], axis=2).max(axis=1, initial=0)
    sides = at[:, 1:] - at[:, :1]
    part = np.abs(np.linalg.det(sides)) / (gdim - 1)  # of an interval or a triangle
    at = np.ascontiguousarray(at)
    return Pieces(facet, x, at, centre, radius, normal, measure, part, curved)
