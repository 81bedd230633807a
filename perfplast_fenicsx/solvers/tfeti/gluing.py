"""Create the gluing matrix B, which joins the copies of torn nodes, and map vectors to pieces.

:class:`TornBodies` maps displacements and forces between the bodies and their pieces.

A node of the mesh has one copy in each of its pieces. At a free component, the m copies have m − 1
orthonormal rows, the k-th of which is (1, …, 1, −k, 0, …)/√(k(k + 1)). At a supported component,
each copy is held. Ties and contact use the mean of the copies; their rows are orthogonal to the
gluing rows. All rows have unit length.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from petsc4py import PETSc

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.contact.rows.constraints import (
    Constraints,
    Entries,
    Sizes,
    entries_of,
    matrix_of_entries,
    unknowns,
)
from perfplast_fenicsx.parallel import send_rows
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.solvers.tfeti.subdomains import Subdomains, TornStiffness


@dataclass(frozen=True)
class Gluing:
    """The rows, distributed like their nodes; on each rank the contact rows come last.

    Attributes:
        B: Matrix from torn unknowns, shape (num_rows, num_torn_unknowns).
        copies: Matrix of ones from displacements to torn unknowns; its transpose sums over the
            copies.
        count: Number of copies of each owned unknown's node.
        num_glue: Number of rows on this rank that glue copies; they come first.
        num_pairs: Number of contact rows on this rank.
        length: Length of each contact row before scaling, shape (num_pairs,).
    """

    B: PETSc.Mat
    copies: PETSc.Mat
    count: Floats
    num_glue: int
    num_pairs: int
    length: Floats


def make_gluing(problem: Problem, pieces: Subdomains) -> Gluing:
    """Return the gluing matrix B of the pieces, with its data. Collective.

    Args:
        problem: The bodies.
        pieces: The pieces of the bodies.
    """
    V, comm, gdim = problem.V, problem.comm, problem.bodies.gdim
    torn_size = len(pieces.node) * gdim
    columns = (torn_size, comm.allreduce(torn_size))
    node, copy = _copies(problem, pieces)
    count = np.bincount(node, minlength=V.dofmap.index_map.size_local)
    place = np.arange(len(node)) - np.repeat(np.cumsum(count) - count, count)
    axis = np.arange(gdim)
    each, its = node[:, None] * gdim + axis, copy[:, None] * gdim + axis
    share = np.repeat(1 / count[node], gdim)
    mean = matrix_of_entries(comm, unknowns(V), columns, [(each.ravel(), its.ravel(), share)])
    number = V.dofmap.index_map.local_to_global(pieces.node)[:, None] * gdim + axis
    ones = (np.arange(torn_size), number.ravel(), np.ones(torn_size))
    copies = matrix_of_entries(comm, columns, unknowns(V), [ones])

    fixed = problem.fixed[: V.dofmap.index_map.size_local]
    glue, num_glue = _glue(place, copy, ~fixed[node])
    held = its[fixed[node]]
    holds = (np.arange(len(held)), held, np.ones(len(held)))
    ties, _ = _of_mean(problem.ties, mean, fixed)
    contact, length = _of_mean(problem.constraints, mean, fixed)
    parts: list[tuple[int, Entries]] = [
        (num_glue, glue),
        (len(held), holds),
        (len(problem.ties.host), ties),
        (len(length), contact),
    ]
    B = _stacked(comm, columns, parts)
    mean.destroy()
    counts = np.repeat(count, gdim).astype(np.float64)
    return Gluing(B, copies, counts, num_glue, len(length), length)


def _stacked(comm: PETSc.Comm, columns: Sizes, parts: Sequence[tuple[int, Entries]]) -> PETSc.Mat:
    """Return a matrix with the rows of all parts, stacked on each rank. Collective."""
    entries: list[Entries] = []
    begun = 0
    for count, (row, column, value) in parts:
        entries.append((row + begun, column, value))
        begun += count
    return matrix_of_entries(comm, (begun, comm.allreduce(begun)), columns, entries)


def _copies(problem: Problem, pieces: Subdomains) -> tuple[Longs, Longs]:
    """Return the local node and the global torn node of each copy of the owned nodes, sorted.

    Collective.
    """
    comm, index_map = problem.comm, problem.V.dofmap.index_map
    ends = np.cumsum(comm.allgather(index_map.size_local))
    number = index_map.local_to_global(pieces.node)
    first = comm.scan(len(number)) - len(number)
    rows = np.column_stack([number, first + np.arange(len(number))])
    arrived = send_rows(comm, rows, np.searchsorted(ends, number, side="right"))
    order = np.lexsort((arrived[:, 1], arrived[:, 0]))
    return arrived[order, 0] - index_map.local_range[0], arrived[order, 1]


def _glue(place: Longs, copy: Longs, free: npt.NDArray[np.bool_]) -> tuple[Entries, int]:
    """Return the orthonormal rows that glue the copies of each node; copies are sorted by node.

    Args:
        place: Index of each copy among the copies of its node.
        copy: Global number of the torn node of each copy.
        free: Components that are glued, shape (num_copies, gdim).

    Returns:
        The entries, and the number of rows.
    """
    which, axis = np.nonzero(free & (place > 0)[:, None])
    k = place[which]
    row = np.repeat(np.arange(len(which)), k + 1)
    begins = np.cumsum(k + 1) - (k + 1)
    within = np.arange(len(row)) - np.repeat(begins, k + 1)
    other = (which - k)[row] + within
    value = np.where(within == k[row], -k[row], 1.0) / np.sqrt(k * (k + 1.0))[row]
    return (row, copy[other] * free.shape[1] + axis[row], value), len(which)


def _of_mean(
    rows: Constraints, mean: PETSc.Mat, fixed: npt.NDArray[np.bool_]
) -> tuple[Entries, Floats]:
    """Return the rows as unit rows in torn unknowns, and their lengths before scaling. Collective.

    Args:
        rows: Rows of ties or contact.
        mean: Matrix that maps torn unknowns to the means of the copies.
        fixed: Components that supports hold, which the function omits, shape (num_nodes, gdim).
    """
    moving, free = rows.B.copy(), rows.B.createVecRight()
    free.array[:] = ~fixed.ravel()
    moving.diagonalScale(None, free)
    torn = moving.matMult(mean)
    row, column, value = entries_of(torn)
    for thing in (moving, free, torn):
        thing.destroy()
    length = np.sqrt(np.bincount(row, value**2, len(rows.host)))
    return (row, column, value / length[row]), length


class TornBodies:
    """Map nodal vectors to torn vectors and back. All methods are collective."""

    def __init__(self, problem: Problem, gluing: Gluing) -> None:
        self._basis, self._copies, self._count = problem.basis, gluing.copies, gluing.count
        self._fixed = problem.fixed[: problem.V.dofmap.index_map.size_local].ravel()
        self._comm = problem.comm
        self._nodal, self._image = problem.create_vector(), problem.create_vector()
        self._torn = gluing.copies.createVecLeft()

    def forces(self, r: PETSc.Vec) -> Floats:
        """Return −r for a gradient r in the jump basis, divided equally among free copies."""
        self._basis.M.multTranspose(r, self._nodal)
        self._nodal.scale(-1)
        return self.shares(self._nodal)

    def shares(self, nodal: PETSc.Vec) -> Floats:
        """Return nodal forces, divided equally among the copies of free nodes."""
        self._image.array[:] = np.where(self._fixed, 0.0, nodal.array_r / self._count)
        self._copies.mult(self._image, self._torn)
        shares: Floats = self._torn.array_r.copy()
        return shares

    def glue(self, u: Floats, delta: PETSc.Vec) -> None:
        """Set δ, in the jump basis, to the mean of u over the copies."""
        self._torn.array[:] = u
        self._copies.multTranspose(self._torn, self._nodal)
        self._nodal.array[:] = np.where(self._fixed, 0.0, self._nodal.array_r / self._count)
        self._basis.M.mult(self._nodal, delta)

    def gradient(self, K: TornStiffness, delta: PETSc.Vec, r: PETSc.Vec, f: PETSc.Vec) -> None:
        """Set f to Kδ + r in the jump basis, zero where supports or ties hold."""
        self._basis.T.mult(delta, self._nodal)
        self._copies.mult(self._nodal, self._torn)
        self._torn.array[:] = K.multiply(self._torn.array_r)
        self._copies.multTranspose(self._torn, self._nodal)
        self._basis.T.multTranspose(self._nodal, f)
        f.axpy(1.0, r)
        f.array[self._fixed] = 0
        f.array[self._basis.tied] = 0
