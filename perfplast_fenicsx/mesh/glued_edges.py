"""Identify coinciding edges of bodies that share no node.

Where bodies touch, each edge occurs twice: once in the surface of each body. If one of the two
edges is cut, the other must be cut too, so that the nodes of the surfaces still match.
"""

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
from dolfinx import la
from dolfinx.mesh import Mesh

from perfplast_fenicsx.arrays import Floats, Longs, PairFlags
from perfplast_fenicsx.mesh.straight_geometry import corners
from perfplast_fenicsx.parallel import Exchange, fetch_rows, send_rows


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
        sums = la.vector(self._map, 3, dtype=np.float64)
        table = sums.array.reshape(-1, 3)
        columns = [weights * lengths, weights, np.ones_like(lengths)]
        np.add.at(table, self.of_cell, np.stack(columns, axis=2))
        sums.scatter_reverse(la.InsertMode.add)
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
