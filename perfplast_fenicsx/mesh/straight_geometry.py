"""Compute vertices, gradients of barycentric coordinates, and outer facets of straight cells."""

import itertools
import math
from dataclasses import dataclass

from mpi4py import MPI

import numpy as np
from dolfinx.mesh import Mesh, exterior_facet_indices

from perfplast_fenicsx.arrays import Floats, Ints, Longs
from perfplast_fenicsx.compat import coordinate_map, entity_nodes, geometry_dofmap


def corners(mesh: Mesh) -> tuple[Ints, Floats]:
    """Return the vertices of this rank's cells. Collective only if connectivities are missing.

    Returns:
        The local vertices of each owned cell, shape (num_cells, tdim + 1), and the coordinates of
        all local vertices.
    """
    topology = mesh.topology
    tdim = topology.dim
    topology.create_connectivity(0, tdim)
    vertices = topology.index_map(0)
    every = np.arange(vertices.size_local + vertices.num_ghosts, dtype=np.int32)
    places = entity_nodes(mesh, 0, every).reshape(-1)
    count = topology.index_map(tdim).size_local
    cells: Ints = topology.connectivity(tdim, 0).array.reshape(-1, tdim + 1)[:count]
    return cells, np.asarray(mesh.geometry.x[places, : mesh.geometry.dim], dtype=np.float64)


def facets_of(tdim: int) -> Longs:
    """Return the vertices of the facet opposite each vertex of a simplex, shape (d + 1, d)."""
    return np.array([*itertools.combinations(range(tdim + 1), tdim)][::-1])


@dataclass(frozen=True)
class OuterFacets:
    """The facets on this rank that belong to only one cell.

    Attributes:
        facets: Local indices of the facets, sorted.
        cells: The cell of each facet.
        places: Index of each facet in its cell; facet i of a simplex is opposite vertex i.
        normals: Outward unit normals, shape (num_facets, gdim).
    """

    facets: Ints
    cells: Ints
    places: Ints
    normals: Floats


def gradients(x: Floats) -> tuple[Floats, Floats]:
    """Return the gradients of barycentric coordinates, and the volumes of simplices.

    Args:
        x: Vertices, shape (..., d + 1, d).

    Returns:
        Gradients, shape (..., d + 1, d), and volumes, shape (...).
    """
    tdim = x.shape[-1]
    edges = x[..., 1:, :] - x[..., :1, :]
    others = np.swapaxes(np.linalg.inv(edges), -1, -2)
    first = -others.sum(axis=-2, keepdims=True)
    volume = np.abs(np.linalg.det(edges)) / math.factorial(tdim)
    return np.concatenate([first, others], axis=-2), volume


def outer_facets(mesh: Mesh) -> OuterFacets:
    """Return the outer facets on this rank. Collective."""
    topology = mesh.topology
    tdim = topology.dim
    topology.create_connectivity(tdim - 1, tdim)
    topology.create_connectivity(tdim, tdim - 1)
    facets = exterior_facet_indices(topology)
    to_cell = topology.connectivity(tdim - 1, tdim)
    cells = to_cell.array[to_cell.offsets[facets]]
    of_cells = topology.connectivity(tdim, tdim - 1).array.reshape(-1, tdim + 1)
    places = np.argmax(of_cells[cells] == facets[:, None], axis=1).astype(np.int32)
    vertices, points = corners(mesh)
    x = points[vertices[cells]]
    inward = np.take_along_axis(gradients(x)[0], places[:, None, None], axis=1)[:, 0]
    normals = -inward / np.linalg.norm(inward, axis=1, keepdims=True)
    return OuterFacets(facets, cells, places, normals)


def has_curved_cells(mesh: Mesh) -> bool:
    """Return whether any cell of the mesh is curved. Collective."""
    cmap, tdim = coordinate_map(mesh), mesh.topology.dim
    if cmap.degree == 1:
        return False
    x = mesh.geometry.x[geometry_dofmap(mesh)]
    vertices = x[:, : tdim + 1]
    layout = cmap.create_dof_layout()
    size = np.ptp(vertices, axis=1).max(axis=1)
    curved = False
    # A midside node counts as straight up to this distance from the middle, relative to the cell.
    rounding = 1e-10
    for edge in range(3 if tdim == 2 else 6):
        ends = [d for d in layout.entity_closure_dofs(1, edge) if d <= tdim]
        (middle,) = layout.entity_dofs(1, edge)
        off = np.linalg.norm(x[:, middle] - vertices[:, ends].mean(axis=1), axis=1)
        curved |= bool((off > rounding * size).any())
    return bool(mesh.comm.allreduce(curved, MPI.LOR))
