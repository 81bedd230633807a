"""Refine meshes; names and matching surfaces are preserved.

Cells are cut at the midpoints of edges (:mod:`bisection`). Cells with large errors are cut so that
their angles remain bounded. Cells around a point are cut into a fan if the stress at the point
depends only on the direction.

Slip bands are thin: cells must be small across a band, but not along it. Edges along which a
field changes are therefore cut earlier than other edges of the same length.

Where bodies touch, each edge occurs twice: once in the surface of each body. If one of the two
edges is cut, the other must be cut too, so that the nodes of the surfaces still match.
"""

from dataclasses import dataclass

from mpi4py import MPI

import basix.ufl
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import la
from dolfinx.mesh import Mesh, create_mesh

from perfplast_fenicsx.arrays import Floats, Ints, Longs, PairFlags
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.mesh.bisection import cut, edges_of_faces, edges_of_simplex
from perfplast_fenicsx.mesh.straight_geometry import corners, has_curved_cells
from perfplast_fenicsx.mesh.tagged_mesh import (
    UNNAMED,
    TaggedMesh,
    cell_meshtags,
    facet_meshtags,
    facet_tags_of,
    values_of,
)
from perfplast_fenicsx.parallel import Exchange, fetch_rows, send_rows, sums_at


class GluedEdges:
    """Local edges of a straight mesh, in the same order on all ranks and on both sides of contacts.

    Attributes:
        of_cell: Local edges of each owned cell, shape (num_cells, edges_per_cell).
        vertices: Local vertices of each local edge, shape (num_edges, 2).
        middles: Midpoints of the edges, shape (num_edges, gdim).
        order: A number for each local edge, shape (num_edges,); longer edges have larger numbers,
            and numbers within a cell differ. The order of two edges of a cell is the same on every
            rank and on both sides of a contact.
        length: Lengths that define ``order``, shape (num_edges,).
    """

    def __init__(
        self,
        mesh: Mesh,
        opposite: Longs,
        metric: Floats | None = None,
        stretches: Floats | None = None,
        shapeless: npt.NDArray[np.bool_] | None = None,
    ) -> None:
        """Find coinciding edges. Collective.

        Args:
            mesh: Triangles or tetrahedra of first order.
            opposite: Pairs of coinciding vertices by global numbers, each on any rank, shape
                (num_pairs, 2).
            metric: Metric M of each owned cell, shape (num_cells, gdim, gdim). The length of an
                edge e is √(e·Me), averaged over its cells; the default is the identity.
            stretches: Factors on the lengths of local edges for their order; the default is 1.
            shapeless: Flags of owned cells whose shape does not matter, shape (num_cells,). Edges
                that belong only to such cells count as short. For other edges such cells are
                ignored.
        """
        topology, comm, tdim = mesh.topology, mesh.comm, mesh.topology.dim
        topology.create_entities(1)
        topology.create_connectivity(tdim, 1)
        topology.create_connectivity(1, 0)
        self._comm, self._map = comm, topology.index_map(1)
        self._owned = self._map.size_local
        num_edges = self._owned + self._map.num_ghosts
        num_cells = topology.index_map(tdim).size_local
        shape = (-1, 3 if tdim == 2 else 6)
        self.of_cell = topology.connectivity(tdim, 1).array.reshape(shape)[:num_cells]
        self.vertices = topology.connectivity(1, 0).array.reshape(num_edges, 2)
        ends = corners(mesh)[1][self.vertices]
        self.middles: Floats = ends.mean(axis=1)

        labels, glued = _labels(mesh, opposite)
        both = glued[self.vertices].all(axis=1)[: self._owned]
        self._twins = np.flatnonzero(both)
        self._meeting = _Meeting(comm, np.sort(labels[self.vertices[self._twins]], axis=1))
        along = ends[:, 1] - ends[:, 0]
        if metric is None and shapeless is None:
            own = np.linalg.norm(along, axis=1)
        else:
            own = self._mean(along, metric, shapeless)
        own = own if stretches is None else own * stretches
        self.length = length = self._largest(own[: self._owned])
        place = self._largest(_place(self.middles[: self._owned]))
        first, last = self._map.local_range
        number = self._largest(np.arange(first, last, dtype=np.float64))
        self.order = np.empty(num_edges, dtype=np.int64)
        self.order[np.lexsort((number, place, length))] = np.arange(num_edges)

    def anywhere(self, marks: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
        """Return which local edges are marked on any rank or on either side. Collective.

        Args:
            marks: Marks of the local edges, shape (num_edges,).
        """
        vector = la.vector(self._map, 1, dtype=np.float64)
        vector.array[:] = marks
        vector.scatter_reverse(la.InsertMode.add)
        found: npt.NDArray[np.bool_] = self._largest(vector.array[: self._owned]) > 0
        return found

    def new_numbers(self, marks: npt.NDArray[np.bool_], first: int) -> Longs:
        """Return the numbers of new vertices on marked edges, and −1 for other edges. Collective.

        Args:
            marks: Result of :meth:`anywhere`.
            first: The first number on this rank.
        """
        mine = marks[: self._owned]
        vector = la.vector(self._map, 1, dtype=np.int64)
        vector.array[: self._owned] = np.where(mine, first - 1 + np.cumsum(mine), -1)
        vector.scatter_forward()
        return vector.array.copy()

    def new_points(self, marks: npt.NDArray[np.bool_]) -> Floats:
        """Return the midpoints of owned marked edges, by edge index, shape (num_new, gdim)."""
        return self.middles[: self._owned][marks[: self._owned]]

    def _mean(
        self, along: Floats, metric: Floats | None, shapeless: npt.NDArray[np.bool_] | None
    ) -> Floats:
        """Return the lengths of owned edges, averaged over their cells. Collective.

        Args:
            along: Vectors along local edges, from end to end, shape (num_edges, gdim).
            metric: See the constructor.
            shapeless: See the constructor.
        """
        edges = along[self.of_cell]
        if metric is None:
            lengths = np.linalg.norm(edges, axis=2)
        else:
            lengths = np.sqrt(np.einsum("cei,cij,cej->ce", edges, metric, edges))
        short = 1e-6  # weight of shapeless cells; edges with only such cells get this factor
        weights = np.ones_like(lengths)
        if shapeless is not None:
            weights[shapeless] = short
        columns = [weights * lengths, weights, np.ones_like(lengths)]
        table = sums_at(self._map, 3, (self.of_cell, np.stack(columns, axis=2)))
        total, weight, count = table[: self._owned].T
        shaped = weight > 0.5  # true if the shape of at least one cell matters
        mean: Floats = total / np.where(shaped, weight, count)
        return mean

    def _largest(self, values: Floats) -> Floats:
        """Return, for each local edge, the larger of its owners' values on both sides."""
        vector = la.vector(self._map, 1, dtype=np.float64)
        vector.array[: self._owned] = values
        vector.array[self._twins] = self._meeting.largest(values[self._twins])
        vector.scatter_forward()
        return vector.array.copy()


def _place(middles: Floats) -> Floats:
    """Return numbers that order edges of equal length in the same way on all ranks."""
    # along this direction, two midpoints of edges hardly ever have the same position
    irrational = np.array([0.754877666, 0.569840291, 0.328125733])
    place: Floats = (middles * irrational[: middles.shape[1]]).sum(axis=1)
    return place


def _labels(mesh: Mesh, opposite: Longs) -> tuple[Longs, PairFlags]:
    """Return for each local vertex the smallest number among the vertices that coincide with it.

    At edges of more than two bodies several vertices coincide, so the number is propagated until
    nothing changes.

    Returns:
        The numbers, and flags of vertices that coincide with another vertex, each of shape
        (num_vertices,).
    """
    comm, vertices = mesh.comm, mesh.topology.index_map(0)
    first, last = vertices.local_range
    ends = np.concatenate([opposite, opposite[:, ::-1]])
    owner = np.searchsorted(comm.allgather(last), ends[:, 0], side="right")
    ends = send_rows(comm, ends, owner)
    mine, other = ends[:, 0] - first, ends[:, 1]
    label = np.arange(first, last, dtype=np.int64)
    glued = np.zeros(label.size, dtype=np.int64)
    glued[mine] = 1
    changed = True
    while changed:
        before = label.copy()
        np.minimum.at(label, mine, fetch_rows(comm, before, other))
        changed = comm.allreduce(bool((label != before).any()), MPI.LOR)
    both = la.vector(vertices, 2, dtype=np.int64)
    both.array[: 2 * label.size] = np.column_stack([label, glued]).ravel()
    both.scatter_forward()
    pairs = both.array.reshape(-1, 2)
    return pairs[:, 0].copy(), pairs[:, 1] > 0


class _Meeting:
    """Send all rows with equal keys, from any rank, to one rank."""

    def __init__(self, comm: MPI.Intracomm, keys: Longs) -> None:
        """Send each key to the rank that is responsible for it. Collective.

        Args:
            comm: The ranks.
            keys: Keys, shape (num_rows, 2).
        """
        self._exchange = Exchange(comm, keys[:, 0] % comm.size)
        met, group = np.unique(self._exchange.forward(keys), axis=0, return_inverse=True)
        self._group, self._count = group.ravel(), len(met)

    def largest(self, values: Floats) -> Floats:
        """Return for each row the largest value of all rows with the same key. Collective."""
        top = np.full(self._count, -np.inf)
        np.maximum.at(top, self._group, self._exchange.forward(values))
        return self._exchange.back(top[self._group])


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

    table = sums_at(edges, 2, (of_cell, np.column_stack([changes.ravel(), most.ravel()])))
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
        metric: Metric of each owned cell (:class:`GluedEdges`).
        gradients: Gradients of m fields in each owned cell, only in 3D, shape (num_cells, 3, m).
        shapeless: Flags of owned cells whose shape does not matter
            (:class:`GluedEdges`).

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
