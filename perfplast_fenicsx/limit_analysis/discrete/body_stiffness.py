"""Assemble and factorise the stiffness of bodies from moduli at each point.

The matrix of a cell is Σ (Bᵀ R)(Bᵀ R)ᵀ over its points. B contains the strain rates of the nodal
unknowns in the coordinates of the point's cone. R is a factor of the moduli RRᵀ at the point. A
compiled kernel adds the cell matrices to blocks of nodes; PETSc adds the blocks of the ranks. In
3D, the assembly of a DOLFINx form takes more than twice as long.

The module also generates the C source of the kernel. The kernel processes four cells at once, and
stores corresponding entries of these cells side by side. Compilers can therefore use the vector
instructions of any processor.
"""

import math

from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.arrays import Floats, Ints, Longs
from perfplast_fenicsx.compiled_kernels import aligned, compiled
from perfplast_fenicsx.contact.rows.constraints import entries_of
from perfplast_fenicsx.limit_analysis.conic.cone import Moduli
from perfplast_fenicsx.limit_analysis.conic.discretisation import NONE, SprungMatrix
from perfplast_fenicsx.limit_analysis.discrete.point_strains import PointStrains
from perfplast_fenicsx.problem.fields.stiffness import create_stiffness
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.profiling import phase
from perfplast_fenicsx.solvers.linear.contact_operator import ContactOperator
from perfplast_fenicsx.solvers.linear.factorisation import DIRECT
from perfplast_fenicsx.solvers.linear.petsc_calls import expect_entries, give_entries


def source() -> str:
    """Return the C source of the function ``body_sums``."""
    return r"""
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#define LANES 4 /* number of cells treated at once; equal entries are adjacent */
typedef double lanes __attribute__((vector_size(8 * LANES), may_alias));
#define OWN static inline __attribute__((always_inline))

/* P = M R at one point, for all four cells */
OWN void product(const int parts, int unknowns, const lanes *M, const lanes *R, lanes *P, int all) {
  for (int i = 0; i < unknowns; ++i, M += parts, P += all)
    for (int j = 0; j < parts; ++j) {
      lanes sum = M[0] * R[j];
      for (int k = 1; k < parts; ++k) sum += M[k] * R[k * parts + j];
      P[j] = sum;
    }
}

/* rows i, i + 1 and columns j to j + 3 of P Pᵀ */
OWN void tile(const lanes *restrict P, int all, int i, int j, int width, lanes *restrict S) {
  const lanes *x = P + i * all, *y = x + all;
  const lanes *a = P + j * all, *b = a + all, *c = b + all, *d = c + all;
  lanes p0 = {0}, p1 = p0, p2 = p0, p3 = p0, q0 = p0, q1 = p0, q2 = p0, q3 = p0;
  for (int k = 0; k < all; ++k) {
    lanes u = x[k], v = y[k];
    p0 += u * a[k], p1 += u * b[k], p2 += u * c[k], p3 += u * d[k];
    q0 += v * a[k], q1 += v * b[k], q2 += v * c[k], q3 += v * d[k];
  }
  lanes *p = S + i * width + j, *q = p + width;
  p[0] = p0, p[1] = p1, p[2] = p2, p[3] = p3;
  q[0] = q0, q[1] = q1, q[2] = q2, q[3] = q3;
}

/* add a cell's matrix, whose lower triangle is in S, to the blocks of its nodes */
OWN void add(const int dim, int nodes, const double *S, int width, const int32_t *place,
             double *sums) {
  for (int a = 0; a < nodes; ++a)
    for (int b = 0; b <= a; ++b) {
      double *here = sums + dim * dim * (int64_t)place[a * nodes + b];
      double *there = sums + dim * dim * (int64_t)place[b * nodes + a];
      for (int i = 0; i < dim; ++i)
        for (int j = 0; j < dim; ++j) {
          int r = dim * a + i, c = dim * b + j;
          double entry = S[LANES * (r >= c ? r * width + c : c * width + r)];
          here[dim * i + j] += entry;
          if (a != b) there[dim * j + i] += entry;
        }
    }
}

/* Σ (M R)(M R)ᵀ over the points of each cell. Entries of M for four cells are adjacent, and zero
   after the last cell. */
void body_sums(int64_t cells, int points, int nodes, int dim, int parts, const double *matrices,
               const double *roots, const int32_t *place, int64_t blocks, double *sums) {
  const int unknowns = dim * nodes, all = points * parts, square = parts * parts;
  const int width = unknowns + 4; /* tiles may extend beyond the last row and column */
  const size_t size = sizeof(lanes) * (size_t)(width * (all + width) + square);
  lanes *P = aligned_alloc(64, (size + 63) / 64 * 64);
  lanes *S = P + width * all, *R = S + width * width;
  memset(P, 0, size);
  memset(sums, 0, sizeof(double) * (size_t)(dim * dim * blocks));
  for (int64_t first = 0; first < cells; first += LANES) {
    for (int p = 0; p < points; ++p) {
      for (int l = 0; l < LANES; ++l) {
        int64_t cell = first + l < cells ? first + l : cells - 1;
        const double *from = roots + (cell * points + p) * square;
        for (int k = 0; k < square; ++k) ((double *)(R + k))[l] = from[k];
      }
      const lanes *M = (const lanes *)matrices + ((first / LANES) * points + p) * unknowns * parts;
      switch (parts) {
        case 7: product(7, unknowns, M, R, P + p * parts, all); break;
        case 5: product(5, unknowns, M, R, P + p * parts, all); break;
        default: product(parts, unknowns, M, R, P + p * parts, all);
      }
    }
    for (int i = 0; i < unknowns; i += 2)
      for (int j = 0; j < i + 2 && j < unknowns; j += 4) tile(P, all, i, j, width, S);
    for (int l = 0; l < LANES && first + l < cells; ++l) {
      const double *own = (const double *)S + l;
      const int32_t *to = place + (first + l) * nodes * nodes;
      if (dim == 3) add(3, nodes, own, width, to, sums);
      else add(2, nodes, own, width, to, sums);
    }
  }
  free(P);
}
"""


class BodyStiffness:
    """Assemble the stiffness K of the bodies for given moduli.

    Attributes:
        matrix: Matrix K, with space for the entries of contact, and with the identity at supports.
    """

    def __init__(self, problem: Problem, points: PointStrains) -> None:
        """Compute the sparsity pattern, and the strain rates of nodal unknowns. Collective.

        Args:
            problem: The problem of the bodies.
            points: Strains at the points of the problem.
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
    """Return a matrix with space for the blocks, and for zeros where contact may add entries.

    Collective.

    Args:
        problem: The problem with the contact.
        rows: Rows of the blocks, global numbers of nodes.
        columns: Columns of the blocks, global numbers of nodes.

    Returns:
        Number of zeros that follow the entries of the blocks; the matrix.
    """
    room = create_stiffness(problem)
    dim, size = room.getBlockSize(), room.getSize()[0] // room.getBlockSize()
    row, column, _ = entries_of(room)
    corners = (row % dim == 0) & (column % dim == 0)  # one entry for each block
    own = (room.getOwnershipRange()[0] + row[corners]) // dim
    known, wanted = np.sort(size * rows + columns), size * own + column[corners] // dim
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


def _rates(problem: Problem, strains: PointStrains, cells: Ints) -> Floats:
    """Return the strain rates of nodal unknowns, in the coordinates of the points' cones.

    Collective.

    The rates of supported unknowns are zero.

    Returns:
        Rates in the order of the kernel, with four cells side by side and zeros after the last
        cell, shape (num_groups, num_points, n, 1 + m, 4).
    """
    at_once, size = 4, problem.S.dofmap.index_map_bs
    num_points, groups = problem.Q.dofmap.list.shape[1], -(-len(cells) // at_once)
    unknowns = problem.V.dofmap.list.shape[1] * problem.V.dofmap.index_map_bs
    shape = (groups, num_points, unknowns, 1 + size, at_once)
    found = aligned(math.prod(shape)).reshape(shape)
    by_cell = np.moveaxis(found, -1, 1)
    padded = np.zeros((groups * at_once, num_points, 1 + size))
    for unknown, rates in enumerate(strains.nodal()):
        padded[: len(cells)] = rates
        by_cell[:, :, :, unknown] = padded.reshape(groups, at_once, num_points, 1 + size)
    return found


class ConicStiffness(SprungMatrix):
    """Stiffness K of displacements in the contact basis; see :class:`discretisation.Stiffness`."""

    def __init__(self, problem: Problem, points: PointStrains) -> None:
        """Compute the sparsity pattern. Collective.

        Args:
            problem: The problem of the displacements.
            points: Strains at the points of the problem.
        """
        self._problem = problem
        self._bodies = BodyStiffness(problem, points)
        self._operator = ContactOperator(problem, self._bodies.matrix)
        super().__init__(problem.comm, self._operator.matrix, problem.basis.index, DIRECT)

    def destroy(self) -> None:
        """Free PETSc's memory. Collective."""
        super().destroy()
        self._bodies.destroy()

    @phase("assembly")
    def assemble(self, moduli: Moduli, held: Ints = NONE) -> None:
        """Assemble K with moduli at the points of this rank. Collective.

        Args:
            moduli: Moduli at the points.
            held: Local (owned) unknowns that stay zero.
        """
        self._bodies.assemble(moduli)
        self._problem.free.hold(self._bodies.matrix)
        self._operator.hold(held)

    def add_springs(self, springs: tuple[Ints, Floats]) -> None:
        """Set springs at a few unknowns; each later assembly adds them to K.

        Args:
            springs: See :meth:`ContactOperator.add_springs`.
        """
        self._operator.add_springs(springs)
