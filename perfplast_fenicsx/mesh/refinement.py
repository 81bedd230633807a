"""Refine meshes; names and matching surfaces are preserved.

Cells are cut at the midpoints of edges (:mod:`bisection`). Cells with large errors are cut so that
their angles remain bounded. Cells around a point are cut into a fan if the stress at the point
depends only on the direction.

Slip bands are thin: cells must be small across a band, but not along it. Edges along which a
field changes are therefore cut earlier than other edges of the same length.
"""

from dataclasses import dataclass

from mpi4py import MPI

import basix.ufl
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import la
from dolfinx.mesh import Mesh, create_mesh

from perfplast_fenicsx.arrays import Floats, Ints, Longs
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.mesh.bisection import cut, edges_of_faces, edges_of_simplex
from perfplast_fenicsx.mesh.glued_edges import GluedEdges
from perfplast_fenicsx.mesh.straight_geometry import corners, has_curved_cells
from perfplast_fenicsx.mesh.tagged_mesh import (
    UNNAMED,
    TaggedMesh,
    cell_meshtags,
    facet_meshtags,
    facet_tags_of,
    values_of,
)
from perfplast_fenicsx.parallel import fetch_rows, send_rows


def edge_stretches(mesh: Mesh, gradients: Floats) -> Floats:
    """Return factors on the lengths of local edges; all ranks have the same factors. Collective.

    A factor is 1/2 plus the change of the fields along the edge, relative to the largest possible
    change for gradients of this size, averaged over the cells at the edge. Cells therefore become
    up to about three times as long as wide.

    Args:
        mesh: Mesh of tetrahedra with straight sides.
        gradients: Gradients of m fields, constant in each owned cell, with ∂f_j/∂x_i in row i and
            column j, shape (num_cells, 3, m).

    Returns:
        Factors, shape (num_edges,), 0.5 to 1.5.
    """
    topology = mesh.topology
    topology.create_entities(1)
    topology.create_connectivity(3, 1)
    owned, edges = len(gradients), topology.index_map(1)
    of_cell = topology.connectivity(3, 1).array.reshape(-1, 6)[:owned].ravel()
    cells, points = corners(mesh)
    x = points[cells[:owned]]
    ends = edges_of_simplex(3)
    along = x[:, ends[:, 1]] - x[:, ends[:, 0]]
    sizes = np.linalg.norm(gradients, axis=(1, 2))[:, None]
    volumes = np.abs(np.linalg.det(x[:, 1:] - x[:, :1]))[:, None]
    changes = np.linalg.norm(along @ gradients, axis=2) * volumes
    most = np.linalg.norm(along, axis=2) * volumes * sizes

    sums = la.vector(edges, 2, dtype=np.float64)
    table = sums.array.reshape(edges.size_local + edges.num_ghosts, 2)
    np.add.at(table, of_cell, np.column_stack([changes.ravel(), most.ravel()]))
    sums.scatter_reverse(la.InsertMode.add)
    sums.scatter_forward()
    share = np.divide(table[:, 0], table[:, 1], out=np.zeros(len(table)), where=table[:, 1] > 0)
    digits = 3  # rounded so that equal edges have equal factors for any order of summation
    stretches: Floats = 0.5 + np.round(share, digits)
    return stretches


@dataclass(frozen=True)
class Refined:
    """A finer mesh, with the parent of each cell.

    Attributes:
        tagged_mesh: The finer mesh, in a new distribution without ghost cells.
        parents: Global index in the coarser mesh of each owned cell's parent cell, shape
            (num_cells,).
    """

    tagged_mesh: TaggedMesh
    parents: Longs


def check_refinable(tagged_mesh: TaggedMesh) -> None:
    """Raise an error for curved cells. Collective.

    Raises:
        InputError: If a cell is curved.
    """
    if has_curved_cells(tagged_mesh.mesh):
        raise InputError(
            "cells are curved, but only straight cells can be refined; save the mesh with "
            "first-order elements (Mesh.ElementOrder = 1 in gmsh)."
        )


def refine(
    tagged_mesh: TaggedMesh,
    marked: npt.NDArray[np.bool_],
    opposite: Longs | None = None,
    metric: Floats | None = None,
    gradients: Floats | None = None,
    shapeless: npt.NDArray[np.bool_] | None = None,
) -> Refined:
    """Return the mesh with marked cells cut at all edges, and others cut to keep it conforming.

    Collective.

    In every triangle with a cut edge, the longest edge is cut first, so angles remain bounded under
    repeated refinement. With a metric, lengths are measured in the metric, and angles remain
    bounded in the metric; marked cells are cut only at edges of at least half the longest length.
    With gradients, edges along which fields change count as longer (:func:`edge_stretches`), and
    marked cells are cut only at the longest edge of each face.

    Args:
        tagged_mesh: Bodies of straight cells; the finer mesh has no midside nodes.
        marked: Marks of the owned cells, shape (num_cells,).
        opposite: Pairs of coinciding vertices where bodies are in contact, by global numbers, each
            on any rank, shape (num_pairs, 2). New vertices on edges between coinciding vertices
            also coincide.
        metric: Metric of each owned cell (:class:`glued_edges.GluedEdges`).
        gradients: Gradients of m fields in each owned cell, only in 3D, shape (num_cells, 3, m).
        shapeless: Flags of owned cells whose shape does not matter
            (:class:`glued_edges.GluedEdges`).

    Raises:
        InputError: If cells are curved.
    """
    check_refinable(tagged_mesh)
    mesh = tagged_mesh.mesh
    stretches = None if gradients is None else edge_stretches(mesh, gradients)
    edges = GluedEdges(mesh, _pairs(opposite), metric, stretches, shapeless)
    marks: npt.NDArray[np.bool_] = np.zeros(len(edges.order), dtype=np.bool_)
    faces = edges.of_cell[:, edges_of_faces(mesh.topology.dim)]
    if stretches is None:
        shortest = (
            0.0 if metric is None else 0.5
        )  # least length of cut edges, relative to the longest edge of the cell
        lengths = edges.length[edges.of_cell]
        long = lengths >= shortest * lengths.max(axis=1, keepdims=True)
        marks[edges.of_cell[long & marked[:, None]]] = True
    else:
        sides = faces[marked].reshape(-1, 3)
        marks[np.take_along_axis(sides, edges.order[sides].argmax(axis=1)[:, None], axis=1)] = True
    marks = _with_longest(mesh.comm, edges, faces.reshape(-1, 3), marks)
    return _cut(tagged_mesh, edges, marks, edges.order[edges.of_cell])


def spread(
    tagged_mesh: TaggedMesh,
    corners_to_cut: npt.NDArray[np.bool_],
    centres: npt.NDArray[np.bool_],
    opposite: Longs | None = None,
    shapeless: npt.NDArray[np.bool_] | None = None,
) -> Refined:
    """Return a plane mesh with cells cut in two from some corners, so they stay long. Collective.

    The edge opposite each of these corners is cut. Cells beyond these edges keep bounded angles as
    in :func:`refine`. Other cells at a centre are only cut in two, and only if the edge opposite
    the centre must be cut; no edge that ends at the centre is cut.

    Args:
        tagged_mesh: Plane mesh, see :func:`refine`.
        corners_to_cut: Flags of the corners of owned cells, shape (num_cells, 3).
        centres: Flags of the corners at which cells stay long, same shape.
        opposite: See :func:`refine`.
        shapeless: See :func:`refine`.
    """
    check_refinable(tagged_mesh)
    edges = GluedEdges(tagged_mesh.mesh, _pairs(opposite), shapeless=shapeless)
    marks: npt.NDArray[np.bool_] = np.zeros(len(edges.order), dtype=np.bool_)
    marks[edges.of_cell[corners_to_cut]] = True  # edge k is opposite corner k
    marks = _with_longest(tagged_mesh.mesh.comm, edges, edges.of_cell, marks, centres)
    first = edges.order[edges.of_cell] + corners_to_cut * len(edges.order)
    return _cut(tagged_mesh, edges, marks, first)


def _with_longest(
    comm: MPI.Intracomm,
    edges: GluedEdges,
    faces: Longs | Ints,
    marks: npt.NDArray[np.bool_],
    left: npt.NDArray[np.bool_] | None = None,
) -> npt.NDArray[np.bool_]:
    """Return marks that also include the longest edge of each triangle with a marked edge.

    Collective.

    Args:
        comm: The ranks.
        edges: Edges of the mesh.
        faces: Edges of each triangle, shape (num_triangles, 3).
        marks: Marks of the local edges.
        left: Flags of edges that, if marked, do not require the longest edge; same shape as
            ``faces``.
    """
    longest = faces[np.arange(len(faces)), edges.order[faces].argmax(axis=1)]
    more = True
    while more:
        marks = edges.anywhere(marks)
        asking = marks[faces] if left is None else marks[faces] & ~left
        wanted = longest[asking.any(axis=1)]
        more = comm.allreduce(not marks[wanted].all(), MPI.LOR)
        marks[wanted] = True
    return marks


def fan(tagged_mesh: TaggedMesh, points: Ints, opposite: Longs | None = None) -> Refined:
    """Return a plane mesh with the cells around points cut in two at the edges opposite the points.

    Collective.

    Args:
        tagged_mesh: Plane mesh, see :func:`refine`.
        points: Local vertices; each must be given on all ranks that have the vertex.
        opposite: See :func:`refine`.

    Raises:
        InputError: If cells are curved or are not triangles.
    """
    check_refinable(tagged_mesh)
    topology = tagged_mesh.mesh.topology
    if topology.dim != 2:
        raise InputError(
            "fans of cells are possible only in plane meshes; refine the mesh instead."
        )
    edges = GluedEdges(tagged_mesh.mesh, _pairs(opposite))
    vertices = topology.connectivity(2, 0).array.reshape(-1, 3)[: len(edges.of_cell)]
    here = np.isin(vertices, points)  # edge k is opposite vertex k
    marks: npt.NDArray[np.bool_] = np.zeros(len(edges.order), dtype=np.bool_)
    marks[edges.of_cell[here]] = True
    marks = edges.anywhere(marks)
    # in the plane, any order of the edges is valid, because cells share no triangular face
    first = edges.order[edges.of_cell] + here * len(edges.order)
    return _cut(tagged_mesh, edges, marks, first)


def fan_around(
    tagged_mesh: TaggedMesh, edges: npt.NDArray[np.bool_], opposite: Longs | None = None
) -> Refined:
    """Return a mesh with tetrahedra cut in two by planes through one of their edges. Collective.

    Each of these tetrahedra is cut at the opposite edge; other cells at this edge are cut too.

    Args:
        tagged_mesh: Mesh of tetrahedra, see :func:`refine`.
        edges: Flags of the edges through which each owned cell is cut, in DOLFINx's order, shape
            (num_cells, 6).
        opposite: See :func:`refine`.

    Raises:
        InputError: If cells are curved.
    """
    check_refinable(tagged_mesh)
    glued = GluedEdges(tagged_mesh.mesh, _pairs(opposite))
    marks: npt.NDArray[np.bool_] = np.zeros(len(glued.order), dtype=np.bool_)
    marks[glued.of_cell[edges[:, ::-1]]] = True  # edge k is opposite edge 5 - k
    marks = glued.anywhere(marks)
    return _cut(tagged_mesh, glued, marks, glued.order[glued.of_cell])


def _pairs(opposite: Longs | None) -> Longs:
    return np.empty((0, 2), dtype=np.int64) if opposite is None else opposite


def _cut(
    tagged_mesh: TaggedMesh, edges: GluedEdges, marks: npt.NDArray[np.bool_], order: Longs
) -> Refined:
    """Return the mesh with cells cut at marked edges, in a new distribution. Collective."""
    mesh = tagged_mesh.mesh
    topology, comm = mesh.topology, mesh.comm
    dim, owned = topology.dim, len(edges.of_cell)
    old, new = corners(mesh)[1][: topology.index_map(0).size_local], edges.new_points(marks)
    first = (comm.scan(len(old) + len(new)) or 0) - len(old) - len(new)
    number = la.vector(topology.index_map(0), 1, dtype=np.int64)
    number.array[: len(old)] = first + np.arange(len(old))
    number.scatter_forward()
    middles = edges.new_numbers(marks, first + len(old))

    vertices = topology.connectivity(dim, 0).array.reshape(-1, dim + 1)[:owned]
    bodies = values_of(tagged_mesh.cell_tags, owned)
    parts = cut(
        number.array[vertices],
        facet_tags_of(tagged_mesh, owned),
        middles[edges.of_cell],
        order,
        inner=UNNAMED,
    )
    numbers = topology.index_map(dim).local_range[0] + parts.parents
    rows = np.column_stack([bodies[parts.parents], numbers, parts.facets, parts.cells])
    rows = _in_order(mesh, rows, parts.parents)
    element = basix.ufl.element("Lagrange", topology.cell_name(), 1, shape=(dim,))
    points = np.concatenate([old, new])
    finer = create_mesh(comm, rows[:, -(dim + 1) :].copy(), x=points, e=ufl.Mesh(element))
    told = fetch_rows(comm, rows, np.asarray(finer.topology.original_cell_index, dtype=np.int64))
    return Refined(
        TaggedMesh(
            mesh=finer,
            cell_tags=cell_meshtags(finer, told[:, 0].astype(np.int32)),
            facet_tags=facet_meshtags(finer, told[:, 2 : dim + 3].astype(np.int32)),
            volumes=tagged_mesh.volumes,
            surfaces=tagged_mesh.surfaces,
            section=tagged_mesh.section,
            taken=tagged_mesh.taken,
        ),
        parents=told[:, 1],
    )


def _in_order(mesh: Mesh, rows: Longs, parents: Longs) -> Longs:
    """Return rows of child cells, redistributed in the input order of their parent cells.

    Collective.

    The new cells then have the same numbers on any number of ranks.
    """
    topology, comm = mesh.topology, mesh.comm
    owned = topology.index_map(topology.dim)
    place = np.asarray(topology.original_cell_index[: owned.size_local], dtype=np.int64)[parents]
    arrived = send_rows(
        comm, np.column_stack([place, rows]), place * comm.size // max(owned.size_global, 1)
    )
    ordered: Longs = arrived[np.argsort(arrived[:, 0], kind="stable"), 1:]
    return ordered
