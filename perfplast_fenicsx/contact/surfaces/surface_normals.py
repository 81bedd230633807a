"""Find nodes of a named surface and their normals, one for each smooth face of a node."""

from dataclasses import dataclass
from typing import Any

import basix
import numpy as np
import numpy.typing as npt
from dolfinx import fem
from dolfinx.mesh import exterior_facet_indices

from perfplast_fenicsx.arrays import Floats, Ints, Longs
from perfplast_fenicsx.compat import coordinate_map, geometry_dofmap
from perfplast_fenicsx.mesh.kinematics import Kinematics
from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh
from perfplast_fenicsx.parallel import Exchange

SHARP = np.cos(np.radians(40.0))
"""Facets at a node belong to different faces if the cosine of their normals is smaller."""


@dataclass(frozen=True)
class FaceNodes:
    """Owned nodes of a surface; a node on an edge of it is listed once for each face.

    Attributes:
        node: Local block dofs, shape (n,).
        normal: Outward unit normals of the face at the node, shape (n, gdim).
        size: Size of the facets around it (length), shape (n,).
        weight: ∫N of its shape function over the face (length, area), shape (n,).
    """

    node: Ints
    normal: Floats
    size: Floats
    weight: Floats


@dataclass(frozen=True)
class SurfaceFacets:
    """Exterior facets of a surface on this rank.

    Attributes:
        nodes: Local block dofs of the displacements on each facet, shape (n, nodes of a facet).
        x: Coordinates of each facet's geometry points, shape (n, points of a facet, gdim).
        normal: Outward unit normal at each facet's nodes, shape (n, nodes of a facet, gdim).
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
    """Indices of facets' nodes in the list of :class:`FaceNodes` on the ranks that own them.

    Attributes:
        rank: The owner of each node of each facet, shape (n, nodes of a facet).
        place: Index of the node in the owner's list, same shape.
        normal: The unit normal of its face, shape (n, nodes of a facet, gdim).
    """

    rank: Ints
    place: Longs
    normal: Floats


def face_nodes(V: fem.FunctionSpace, tagged_mesh: TaggedMesh, surface: str) -> FaceNodes:
    """Return the nodes of a surface, vertices and midsides, with their normals. Collective.

    The normal of a face at a node is the mean over its facets there, weighted by area. Facets that
    differ by more than 40° are different faces. A smooth surface, flat or curved, gives one normal
    to each node, and an edge between flat faces gives one for each of them.
    """
    return faces_of(V, surface_facets(V, tagged_mesh, surface))[0]


def faces_of(V: fem.FunctionSpace, facets: SurfaceFacets) -> tuple[FaceNodes, FaceNumbers]:
    """Return the nodes of facets, as :func:`face_nodes`, and the indices of each facet's nodes.

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
    """Return the number of the face of each row among those of its node.

    A face contains all facets whose normal differs by less than 40° from one of its facets. For
    coarse facets the choice of this facet matters. It is the facet most perpendicular to a fixed
    direction, so that the choice is the same on all ranks and on both sides of a contact.
    """
    face = np.full(len(node), -1)
    place = np.empty(len(node), dtype=np.int64)
    # Decimal places for the comparison of facets: facets in one plane differ by rounding.
    decimals = 9
    # A direction about which facets of few bodies are symmetric.
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
    """Return the geometry of exterior facets of this rank. Not collective.

    Args:
        V: Displacement space.
        tagged_mesh: Its mesh with names.
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
    """Return normals at points of facets, with the length of the facet's area element.

    Args:
        geometry: Geometry of the coordinates.
        x: Coordinates of facets, shape (n, points of a facet, gdim).
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
    """Return ∫N of each node of facets, shape (n, nodes of a facet)."""
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
