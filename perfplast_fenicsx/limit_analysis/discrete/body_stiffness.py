"""Assemble the stiffness of bodies in nodal unknowns, with moduli given at each point.

Matrices of cells are Σ (Bᵀ R)(Bᵀ R)ᵀ. B are the strain rates of nodal unknowns in the coordinates
of the points' cones, and R is a root of the moduli there. A kernel adds the matrices to blocks of
nodes, and PETSc adds the blocks of the ranks. A form of DOLFINx takes more than twice as long in
space.
"""

import math

from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.arrays import Floats, Ints, Longs
from perfplast_fenicsx.compiled_kernels import aligned, compiled
from perfplast_fenicsx.limit_analysis.conic.cone import Moduli
from perfplast_fenicsx.limit_analysis.discrete.body_source import source
from perfplast_fenicsx.limit_analysis.discrete.point_strains import PointStrains
from perfplast_fenicsx.problem.fields.stiffness import create_stiffness
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.solvers.linear.petsc_calls import expect_entries, give_entries


class BodyStiffness:
    """K, which is assembled again for each set of moduli.

    Attributes:
        matrix: K, with room for the entries of contact, and the identity at supports.
    """

    def __init__(self, problem: Problem, points: PointStrains) -> None:
        """Compute the pattern, and the strain rates of nodal unknowns. Collective.

        Args:
            problem: The problem of the bodies.
            points: Strains at its points.
        """
        self._kernels, self._ffi = compiled(problem.comm, source())
        topology, V = problem.tagged_mesh.mesh.topology, problem.V
        cells = np.arange(topology.index_map(topology.dim).size_local, dtype=np.int32)
        nodes = V.dofmap.list[cells]
        self._dim = V.dofmap.index_map_bs
        self._points = problem.Q.dofmap.list[cells]
        self._weights = np.sqrt(points.weights)[:, None, None]
        self._rates, self._shape = _rates(problem, points, cells), nodes.shape
        known = V.dofmap.index_map.size_local + V.dofmap.index_map.num_ghosts
        pairs = known * nodes[:, :, None].astype(np.int64) + nodes[:, None]
        blocks, place = np.unique(pairs, return_inverse=True)
        self._place: Ints = place.astype(np.int32).ravel()
        numbers = V.dofmap.index_map.local_to_global(np.arange(known, dtype=np.int32))
        rows, columns = (numbers[at] for at in divmod(blocks, known))
        self._sums = np.zeros(len(blocks) * self._dim**2)
        self._room, self.matrix = _matrix(problem, rows, columns)
        self._fixed = np.flatnonzero(problem.fixed[: V.dofmap.index_map.size_local])

    def destroy(self) -> None:
        """Free PETSc's memory. Collective."""
        self.matrix.destroy()

    def assemble(self, moduli: Moduli) -> None:
        """Assemble K with moduli at the points of this rank. Collective."""
        roots = (moduli.roots() * self._weights)[self._points]
        (cells, nodes), parts = self._shape, self._rates.shape[3]
        given = (self._ffi.from_buffer("double[]", array) for array in (self._rates, roots))
        place = self._ffi.from_buffer("int32_t[]", self._place)
        sums = self._ffi.from_buffer("double[]", self._sums)
        sizes = cells, self._points.shape[1], nodes, self._dim, parts
        self._kernels.body_sums(*sizes, *given, place, self._sums.size // self._dim**2, sums)
        give_entries(self.matrix, np.concatenate([self._sums, np.zeros(self._room)]))
        diagonal = self.matrix.getDiagonal()
        diagonal.array[self._fixed] = 1.0
        self.matrix.setDiagonal(diagonal)
        diagonal.destroy()


def _matrix(problem: Problem, rows: Longs, columns: Longs) -> tuple[int, PETSc.Mat]:
    """Return a matrix with room for these blocks, and for the zeros that contact may fill.

    Collective.

    Args:
        problem: The problem with the contact.
        rows: Rows of the blocks, global numbers of nodes.
        columns: Columns of the blocks, global numbers of nodes.

    Returns:
        Number of zeros that follow the blocks' entries; the matrix.
    """
    room = create_stiffness(problem)
    dim, size = room.getBlockSize(), room.getSize()[0] // room.getBlockSize()
    pointer, entries = _blocks(room)
    first = room.getOwnershipRange()[0] // dim
    own = first + np.repeat(np.arange(len(pointer) - 1), np.diff(pointer))
    known, wanted = np.sort(size * rows + columns), size * own + entries
    at = np.minimum(np.searchsorted(known, wanted), len(known) - 1)
    further = wanted[known[at] != wanted] if len(known) else wanted
    i = np.concatenate([rows, further // size])
    j = np.concatenate([columns, further % size])
    inside = np.arange(dim)
    i = dim * i[:, None, None] + inside[:, None] + 0 * inside
    j = dim * j[:, None, None] + 0 * inside[:, None] + inside
    matrix = PETSc.Mat().create(problem.comm)
    matrix.setSizes(room.getSizes(), bsize=dim)
    matrix.setType(PETSc.Mat.Type.AIJ)
    expect_entries(matrix, i.ravel(), j.ravel())
    room.destroy()
    return len(further) * dim**2, matrix


def _blocks(room: PETSc.Mat) -> tuple[Longs, Longs]:
    """Return the start of each row of blocks, and the columns of its blocks."""
    pointer, columns, _ = room.getValuesCSR()
    dim = room.getBlockSize()
    starts = np.repeat(pointer[:-1:dim], np.diff(pointer)[::dim] // dim)
    counts = np.diff(pointer)[::dim] // dim
    firsts = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    within = np.arange(firsts[-1]) - np.repeat(firsts[:-1], counts)
    return firsts, columns[starts + dim * within].astype(np.int64) // dim


def _rates(problem: Problem, strains: PointStrains, cells: Ints) -> Floats:
    """Return strain rates of nodal unknowns in the coordinates of the points' cones. Collective.

    The rates of held unknowns are zero.

    Returns:
        Rates in the order of the kernel: four cells side by side, zero after the last cell, shape
        (num_groups, num_points, n, 1 + m, 4).
    """
    at_once, size = 4, problem.S.dofmap.index_map_bs
    num_points = problem.Q.dofmap.list.shape[1]
    groups, unknowns = (
        -(-len(cells) // at_once),
        problem.V.dofmap.list.shape[1] * problem.V.dofmap.index_map_bs,
    )
    shape = (groups, num_points, unknowns, 1 + size, at_once)
    found = aligned(math.prod(shape)).reshape(shape)
    by_cell = np.moveaxis(found, -1, 1)
    padded = np.zeros((groups * at_once, num_points, 1 + size))
    for unknown, rates in enumerate(strains.nodal()):
        padded[: len(cells)] = rates
        by_cell[:, :, :, unknown] = padded.reshape(groups, at_once, num_points, 1 + size)
    return found
