"""Divide the cells of each rank into subdomains with their own nodes and rigid motions.

A piece is connected through facets, so that its only motion without strain is that of one rigid
body. Its nodes are copies of the mesh's nodes, torn from those of other pieces.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.linalg import qr
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from perfplast_fenicsx.arrays import Floats, Ints, Longs
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.problem.problem import Problem


@dataclass(frozen=True)
class Subdomains:
    """The pieces of this rank; torn nodes are numbered piece by piece.

    Attributes:
        first: Global number of this rank's first piece.
        count: Number of pieces of this rank.
        total: Number of pieces on all ranks.
        torn: Torn node of each owned cell's nodes, shape (num_cells, nodes of a cell).
        node: The local block dof of each torn node, shape (num_torn,).
        ends: First torn node of each piece, and the number of torn nodes, shape (count + 1,).
        motions: Orthonormal rigid motions R of each piece, shape (num_torn, gdim, num_modes).
        fixing: Torn unknowns that fix each piece, as many as it has rigid motions.
    """

    first: int
    count: int
    total: int
    torn: Ints
    node: Ints
    ends: Longs
    motions: Floats
    fixing: Ints

    @property
    def of_node(self) -> Longs:
        """Return the piece of each torn node, with global numbers."""
        return self.first + np.repeat(np.arange(self.count), np.diff(self.ends))


def make_subdomains(problem: Problem, wanted: int, exactly: bool = False) -> Subdomains:
    """Divide the bodies into pieces. Collective.

    Args:
        problem: The bodies.
        wanted: Number of pieces on all ranks; there is at least one for each part of a body on a
            rank that is connected by facets.
        exactly: Whether to refuse a smaller number than that.

    Raises:
        InputError: If the number is refused.
    """
    V, comm = problem.V, problem.comm
    topology = V.mesh.topology
    owned = topology.index_map(topology.dim).size_local
    nodes = V.dofmap.list[:owned]
    x = V.tabulate_dof_coordinates()
    middles = x[nodes].mean(axis=1)[:, : problem.bodies.gdim]
    share = comm.allreduce(owned) / wanted
    label = _connected(problem, np.zeros(owned, dtype=np.int32))
    least = comm.allreduce(int(label.max(initial=-1)) + 1)
    if exactly and wanted < least:
        raise InputError(
            f"subdomains = {wanted} is less than the {least} parts of bodies on "
            f"{comm.size} ranks; give {least} or more, use fewer ranks, or remove it."
        )
    pieces = np.empty(owned, dtype=np.int32)
    begun = 0
    for part in range(label.max(initial=-1) + 1):
        cells = np.flatnonzero(label == part)
        number = max(1, round(len(cells) / share))
        pieces[cells] = begun + bisected(middles[cells], min(number, len(cells)))
        begun += number
    of_cell = _connected(problem, pieces)
    count = int(of_cell.max(initial=-1)) + 1
    size = len(x)
    keys, torn = np.unique(of_cell[:, None].astype(np.int64) * size + nodes, return_inverse=True)
    node = (keys % size).astype(np.int32)
    ends = np.searchsorted(keys // size, np.arange(count + 1))
    motions, fixing = _rigid(problem, x[node], ends)
    last = comm.scan(count)
    total = comm.allreduce(count)
    torn = torn.reshape(nodes.shape).astype(np.int32)
    return Subdomains(last - count, count, total, torn, node, ends, motions, fixing)


def bisected(x: Floats, count: int) -> Ints:
    """Return sets of points of similar size, by bisection of the longest side of their box.

    Args:
        x: Points, shape (n, gdim).
        count: Number of sets, at most n.

    Returns:
        The set of each point, shape (n,).
    """
    label = np.zeros(len(x), dtype=np.int32)
    if count < 2:
        return label
    axis = int(np.argmax(np.ptp(x, axis=0)))
    order = np.argsort(x[:, axis], kind="stable")
    half = count // 2
    cut = round(len(x) * half / count)
    low, high = order[:cut], order[cut:]
    label[low] = bisected(x[low], half)
    label[high] = half + bisected(x[high], count - half)
    return label


def _connected(problem: Problem, label: Ints) -> Ints:
    """Return parts of equal label that are connected by facets, numbered from 0. Collective."""
    topology = problem.V.mesh.topology
    topology.create_connectivity(topology.dim - 1, topology.dim)
    to_cell = topology.connectivity(topology.dim - 1, topology.dim)
    between = np.diff(to_cell.offsets) == 2
    first = to_cell.offsets[:-1][between]
    a, b = to_cell.array[first], to_cell.array[first + 1]
    here = (a < len(label)) & (b < len(label))
    a, b = a[here], b[here]
    same = label[a] == label[b]
    ones = np.ones(int(same.sum()), dtype=np.int8)
    graph = coo_array((ones, (a[same], b[same])), shape=(len(label), len(label)))
    return connected_components(graph, directed=False)[1].astype(np.int32)


def _rigid(problem: Problem, x: Floats, ends: Longs) -> tuple[Floats, Ints]:
    """Return orthonormal motions of each piece, and the unknowns that fix them best."""
    bodies = problem.bodies
    gdim, modes = bodies.gdim, bodies.num_modes
    motions, fixing = np.zeros((len(x), gdim, modes)), []
    for begin, end in pairwise(ends):
        here = x[begin:end]
        centred = here - here.mean(axis=0)
        spread = bodies.kinematics.rigid_modes(centred / np.abs(centred).max())
        basis, _ = np.linalg.qr(spread.reshape(-1, modes))
        motions[begin:end] = basis.reshape(-1, gdim, modes)
        _, _, pivots = qr(basis.T, mode="economic", pivoting=True)
        fixing.append(begin * gdim + pivots[:modes])
    return motions, np.concatenate([np.zeros(0, dtype=np.int32), *fixing]).astype(np.int32)
