"""Collect the facets and nodes of a named surface, with normals, as rows that ranks exchange."""

from dataclasses import dataclass
from typing import Any

from mpi4py import MPI

import basix
import numpy as np
import numpy.typing as npt
from dolfinx import fem
from dolfinx.mesh import exterior_facet_indices

from perfplast_fenicsx.arrays import Floats, Ints, Longs
from perfplast_fenicsx.compat import coordinate_map, geometry_dofmap
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.mesh.kinematics import Kinematics
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.parallel import Exchange, bounding_box

SHARP = np.cos(np.radians(40.0))
"""Cosine of the angle between normals below which facets at a node belong to different faces."""


@dataclass(frozen=True)
class FaceNodes:
    """Owned nodes of a surface; a node on an edge of the surface is listed once for each face.

    Attributes:
        node: Local block dofs, shape (n,).
        normal: Outward unit normal of the face at each node, shape (n, gdim).
        size: Mean size of the facets around each node (length), shape (n,).
        weight: ∫N of the shape function of each node over the face (length or area), shape (n,).
    """

    node: Ints
    normal: Floats
    size: Floats
    weight: Floats


@dataclass(frozen=True)
class SurfaceFacets:
    """Exterior facets of a surface on this rank.

    Attributes:
        nodes: Local block dofs of the displacement on each facet, shape (n, nodes of a facet).
        x: Coordinates of the geometry points of each facet, shape (n, points of a facet, gdim).
        normal: Outward unit normal at the nodes of each facet, shape (n, nodes of a facet, gdim).
        area: Length or area of each facet, shape (n,).
        weight: ∫N of the shape function of each node over each facet, shape (n, nodes of a facet).
    """

    nodes: Ints
    x: Floats
    normal: Floats
    area: Floats
    weight: Floats


@dataclass(frozen=True)
class FaceNumbers:
    """Indices of the facets' nodes in the lists of :class:`FaceNodes` on the owning ranks.

    Attributes:
        rank: Owner of each node of each facet, shape (n, nodes of a facet).
        place: Index of the node in the list of the owner, same shape.
        normal: Unit normal of the face to which the facet belongs, shape (n, nodes of a facet,
            gdim).
    """

    rank: Ints
    place: Longs
    normal: Floats


def face_nodes(V: fem.FunctionSpace, tagged_mesh: TaggedMesh, surface: str) -> FaceNodes:
    """Return the nodes of a surface, vertices and midside nodes, with their normals. Collective.

    The normal of a face at a node is the mean over the facets of the face at the node, weighted by
    area. Facets whose normals differ by more than 40° belong to different faces. A smooth surface,
    flat or curved, has one normal at each node; at an edge between flat faces, a node has one
    normal for each face.
    """
    return faces_of(V, surface_facets(V, tagged_mesh, surface))[0]


def faces_of(V: fem.FunctionSpace, facets: SurfaceFacets) -> tuple[FaceNodes, FaceNumbers]:
    """Return the nodes of facets as :func:`face_nodes` does, and the indices of each facet's nodes.

    Collective.
    """
    comm, index_map, gdim = V.mesh.comm, V.dofmap.index_map, V.mesh.geometry.dim
    nodes = facets.nodes.ravel()
    owners = np.full(index_map.size_local + index_map.num_ghosts, comm.rank, dtype=np.int32)
    owners[index_map.size_local :] = index_map.owners
    rows: npt.NDArray[np.void] = np.empty(
        len(nodes),
        dtype=[
            ("node", np.int64),
            ("normal", np.float64, gdim),
            ("area", np.float64),
            ("weight", np.float64),
        ],
    )
    rows["node"] = index_map.local_to_global(nodes)
    rows["normal"] = facets.normal.reshape(-1, gdim)
    rows["area"] = np.repeat(facets.area, facets.nodes.shape[1])
    rows["weight"] = facets.weight.ravel()
    sent = Exchange(comm, owners[nodes])
    rows = sent.forward(rows)
    order = np.argsort(rows["node"], kind="stable")
    rows = rows[order]
    node, normals, areas = rows["node"], rows["normal"], rows["area"]

    corner, face = np.unique(
        np.stack([node, _faces(node, normals)], axis=1), axis=0, return_inverse=True
    )
    total = np.zeros((len(corner), gdim))
    np.add.at(total, face, normals * areas[:, None])
    area = np.bincount(face, weights=areas, minlength=len(corner))
    count = np.maximum(np.bincount(face, minlength=len(corner)), 1)
    found = FaceNodes(
        (corner[:, 0] - index_map.local_range[0]).astype(np.int32),
        total / np.linalg.norm(total, axis=1, keepdims=True),
        (area / count) ** (1 / (gdim - 1)),
        np.bincount(face, weights=rows["weight"], minlength=len(corner)).astype(np.float64),
    )
    place = np.empty(len(rows), dtype=np.int64)
    place[order] = face
    numbers = FaceNumbers(
        owners[nodes].reshape(facets.nodes.shape),
        sent.back(place).reshape(facets.nodes.shape),
        sent.back(found.normal[place]).reshape(facets.normal.shape),
    )
    return found, numbers


def _faces(node: Longs, normals: Floats) -> Longs:
    """Return the number of each row's face; faces are numbered separately at each node.

    A face contains all facets whose normals differ by less than 40° from the normal of one of its
    facets, the reference facet. For coarse facets the choice of the reference facet matters. The
    function takes the facet most nearly perpendicular to a fixed direction, so that the choice is
    the same on all ranks and on both sides of a contact.
    """
    face = np.full(len(node), -1)
    place = np.empty(len(node), dtype=np.int64)
    # Decimal places in the comparison of facets: facets in one plane differ by rounding errors.
    decimals = 9
    # A direction that is not a symmetry axis of the facets in most bodies.
    askew = np.sqrt([1.0, 2.0, 3.0])
    steepness = np.round((normals @ askew[: normals.shape[1]]) ** 2, decimals)
    place[np.lexsort((steepness, node))] = np.arange(len(node))
    number = 0
    while (left := np.flatnonzero(face < 0)).size:
        left = left[np.argsort(place[left])]
        _, first, inverse = np.unique(node[left], return_index=True, return_inverse=True)
        seed = normals[left[first]][inverse]
        alike = np.einsum("ni,ni->n", seed, normals[left]) >= SHARP
        alike[first] = True
        face[left[alike]] = number
        number += 1
    return face


def surface_facets(V: fem.FunctionSpace, tagged_mesh: TaggedMesh, surface: str) -> SurfaceFacets:
    """Return the exterior facets of a surface on this rank. Not collective."""
    facets = np.intersect1d(tagged_mesh.facets(surface), exterior_facets(tagged_mesh))
    return outer_facets(V, tagged_mesh, facets)


def exterior_facets(tagged_mesh: TaggedMesh) -> Ints:
    """Return the local indices of the exterior facets that this rank owns. Not collective."""
    topology = tagged_mesh.mesh.topology
    topology.create_connectivity(topology.dim - 1, topology.dim)
    return np.asarray(exterior_facet_indices(topology), dtype=np.int32)


def outer_facets(V: fem.FunctionSpace, tagged_mesh: TaggedMesh, facets: Ints) -> SurfaceFacets:
    """Return the geometry of exterior facets on this rank. Not collective.

    Args:
        V: Displacement space.
        tagged_mesh: Mesh of V, with named bodies and surfaces.
        facets: Local indices of exterior facets, sorted, shape (n,).
    """
    mesh = V.mesh
    tdim, gdim = mesh.topology.dim, mesh.geometry.dim
    mesh.topology.create_connectivity(tdim - 1, tdim)
    mesh.topology.create_connectivity(tdim, tdim - 1)
    to_cell = mesh.topology.connectivity(tdim - 1, tdim)
    to_facet = mesh.topology.connectivity(tdim, tdim - 1).array.reshape(-1, tdim + 1)
    cells = to_cell.array[to_cell.offsets[facets]]
    local = np.argmax(to_facet[cells] == facets[:, None], axis=1)

    def of_facets(dofmap: Ints, layout: Any) -> Ints:
        closure = [layout.entity_closure_dofs(tdim - 1, i) for i in range(tdim + 1)]
        return dofmap[cells[:, None], np.array(closure)[local]]

    cmap = coordinate_map(mesh)
    nodes = of_facets(V.dofmap.list, V.dofmap.dof_layout)
    corners = of_facets(geometry_dofmap(mesh), cmap.create_dof_layout())
    x = mesh.geometry.x[corners][:, :, :gdim].astype(np.float64)
    degree = V.element.basix_element.degree
    normals = _crossed(_lagrange(tdim - 1, cmap.degree), x, _nodes(tdim - 1, degree))
    centre = mesh.geometry.x[geometry_dofmap(mesh)[cells, : tdim + 1]].mean(axis=1)[:, :gdim]
    outward = np.einsum("fi,fi->f", normals.mean(axis=1), x[:, :tdim].mean(axis=1) - centre) > 0
    normals[~outward] *= -1
    lengths = np.linalg.norm(normals, axis=2)
    areas = lengths.mean(axis=1) / (2 if tdim == 3 else 1)
    weight = _weights(tdim - 1, degree, cmap.degree, x, tagged_mesh.kinematics)
    return SurfaceFacets(nodes, x, normals / lengths[:, :, None], areas, weight)


def _crossed(geometry: basix.finite_element.FiniteElement, x: Floats, points: Floats) -> Floats:
    """Return normals at points of facets; their length is the area element of the facet.

    Args:
        geometry: Element of the coordinates.
        x: Coordinates of the facets, shape (n, points of a facet, gdim).
        points: Points on the reference facet, shape (p, gdim − 1).

    Returns:
        Normals, shape (n, p, gdim).
    """
    slopes = np.asarray(geometry.tabulate(1, np.asarray(points)))[1:, :, :, 0]
    tangents = np.einsum("dpb,fbi->fpdi", slopes, x)
    if len(slopes) == 2:
        return np.asarray(np.cross(tangents[:, :, 0], tangents[:, :, 1]), dtype=np.float64)
    return np.stack([tangents[:, :, 0, 1], -tangents[:, :, 0, 0]], axis=2)


def _weights(dim: int, degree: int, geometry: int, x: Floats, kinematics: Kinematics) -> Floats:
    """Return ∫N for each node of each facet, shape (n, nodes of a facet)."""
    element = _lagrange(dim, degree)
    rule = basix.make_quadrature(element.cell_type, degree + 2 * geometry)
    points, weights = (np.asarray(part, dtype=np.float64) for part in rule)
    N = np.asarray(element.tabulate(0, points))[0, :, :, 0]
    lengths = np.linalg.norm(_crossed(_lagrange(dim, geometry), x, points), axis=2)
    shapes = np.asarray(_lagrange(dim, geometry).tabulate(0, points))[0, :, :, 0]
    lengths *= kinematics.around(np.einsum("qb,fbi->fqi", shapes, x))
    return np.asarray(np.einsum("q,fq,qk->fk", weights, lengths, N), dtype=np.float64)


def _nodes(dim: int, degree: int) -> Floats:
    return np.asarray(_lagrange(dim, degree).points, dtype=np.float64)


def _lagrange(dim: int, degree: int) -> basix.finite_element.FiniteElement:
    """Return the Lagrange element of a facet, with equally spaced nodes."""
    kind = basix.CellType.triangle if dim == 2 else basix.CellType.interval
    variant = basix.LagrangeVariant.equispaced
    return basix.create_element(basix.ElementFamily.P, kind, degree, variant)


LEAST_COSINE = 0.1
"""Smallest |n_i| for which the normal jump may replace component i of the host. Smaller pivots make
the change of basis T ill-conditioned."""

SurfaceNodes = npt.NDArray[np.void]
"""Rows of :func:`surface_node_type`; a node on an edge has one row for each face of the surface."""


def surface_node_type(gdim: int) -> np.dtype:
    """Return the structured NumPy type of a surface node.

    Its fields are the coordinates ``x`` (3 numbers), the ``rank`` that owns the node, the local
    block dof ``node`` on that rank and the global number ``number``. Further fields are the
    ``size`` of the facets around the node (length), the ``weight`` ∫N (length or area) of its shape
    function over the face, and the face's outward unit ``normal``. ``free`` marks the components
    that no support holds. ``taken`` is Σ m mᵀ over the directions m in which rows of other contacts
    use the node as their host.
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
    """Return rows for the owned nodes of a surface. Collective.

    Args:
        V: Displacement space.
        tagged_mesh: Mesh with named bodies and surfaces.
        surface: Name of the surface.
        fixed: Components at each local node that supports hold, shape (num_nodes, gdim).
    """
    return rows_of_nodes(V, face_nodes(V, tagged_mesh, surface), fixed)


def rows_of_nodes(
    V: fem.FunctionSpace, faces: FaceNodes, fixed: npt.NDArray[np.bool_]
) -> SurfaceNodes:
    """Return rows for nodes whose faces are known. Not collective."""
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
            f"{place}: '{surface}' has no facet on the outside of a body; name surfaces of bodies "
            "that share no nodes (write_split separates bodies that share nodes)."
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
    """Return unit vectors along the free parts of normals, shape (n, gdim); 0 if nothing is free.

    Args:
        normal: Normals, shape (n, gdim).
        free: Components that no support holds, shape (n, gdim).
    """
    left = normal * free
    length = np.linalg.norm(left, axis=1, keepdims=True)
    return np.divide(left, length, out=np.zeros_like(left), where=length > 0)


def crowded(nodes: SurfaceNodes, normal: Floats) -> Floats:
    """Return Σ (m·n)² over the directions m that other rows use: 0 if n is normal to all m.

    Args:
        nodes: Nodes, shape (n,).
        normal: Direction n of the next row, shape (n, gdim).
    """
    along = directions(normal, nodes["free"])
    shares: Floats = np.einsum("ni,nij,nj->n", along, nodes["taken"], along)
    return shares


def extent(comm: MPI.Intracomm, x: Floats) -> float:
    """Return the diagonal of the bounding box of points on all ranks (length). Collective."""
    low, high = bounding_box(comm, x)
    return float(np.linalg.norm(high - low))


Facets = npt.NDArray[np.void]
"""Rows of :func:`facet_type`."""

STRAIGHT = 1e-12
"""Largest distance of a straight facet's midside nodes from midpoints, relative to its size."""

EDGES = {2: ((0, 1),), 3: ((1, 2), (0, 2), (0, 1))}
"""Vertices at the ends of each edge of a facet, in the order of the midside nodes."""

_SPLIT = {
    2: ((0, 2), (2, 1)),
    3: ((0, 5, 4), (5, 1, 3), (4, 3, 2), (3, 4, 5)),
}
"""Points of the pieces of a curved second-order facet, by the space dimension."""


def facet_type(gdim: int, nodes: int, points: int) -> np.dtype:
    """Return the structured NumPy type of a surface facet.

    Its field ``x`` contains the coordinates of the facet's geometry points. For each node of the
    facet, further fields are the coordinates ``at``, the outward unit ``normal`` of the face, the
    global block dof ``node``, the ``rank`` that owns the node, and its ``place`` (index) in that
    rank's rows of the surface.
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
    """Return rows for the owned nodes of a surface, and for its facets on this rank. Collective.

    Args:
        V: Displacement space.
        tagged_mesh: Mesh with named bodies and surfaces.
        surface: Name of the surface.
        fixed: Components at each local node that supports hold, shape (num_nodes, gdim).
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
    """Return the Lagrange shape functions of facets at points.

    Args:
        gdim: Space dimension.
        count: Number of functions on a facet, which determines their degree.
        points: Reference coordinates, shape (..., gdim − 1).
        derivatives: 1 for first derivatives, 0 for values.

    Returns:
        Values, shape (..., count), or derivatives, shape (gdim − 1, ..., count).
    """
    shape = (*points.shape[:-1], count)
    if not points.size:  # basix would abort the process for this input
        return np.zeros((gdim - 1, *shape) if derivatives else shape)
    kind = basix.CellType.interval if gdim == 2 else basix.CellType.triangle
    variant = basix.LagrangeVariant.equispaced
    element = basix.create_element(basix.ElementFamily.P, kind, 1 if count == gdim else 2, variant)
    table = np.asarray(element.tabulate(derivatives, points.reshape(-1, gdim - 1)))[..., 0]
    return table[1:].reshape(gdim - 1, *shape) if derivatives else table[0].reshape(shape)


@dataclass(frozen=True)
class Pieces:
    """Straight simplices that approximate facets: 1 per straight facet, 2 or 4 per curved facet.

    Attributes:
        facet: Number of the facet, shape (n,).
        x: Corners, shape (n, gdim, gdim).
        at: Reference coordinates of the corners on the facet, shape (n, gdim, gdim − 1).
        centre: Centre of the piece, shape (n, gdim).
        radius: Distance from the centre to the farthest corner, shape (n,).
        normal: Outward unit normal, shape (n, gdim).
        measure: Length or area of the piece, shape (n,).
        part: Length or area of the piece in the reference facet, shape (n,).
        curved: Whether the facet of the piece is curved, shape (n,).
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
    """Return the pieces that approximate the facets."""
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
    part = np.abs(np.linalg.det(sides)) / (gdim - 1)  # measure of an interval or a triangle
    at = np.ascontiguousarray(at)
    return Pieces(facet, x, at, centre, radius, normal, measure, part, curved)
