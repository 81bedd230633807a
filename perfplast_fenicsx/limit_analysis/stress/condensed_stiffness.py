"""Assemble and factorise the stiffness K of multipliers, condensed to the facets of cells.

The module also generates C kernels that eliminate the inner unknowns of cells. The kernels process
four cells at once and store corresponding entries of these cells side by side. Compilers can
therefore use the vector instructions of any processor. In the kernels, inner unknowns come first,
and the diagonal of L contains inverse values.
"""

from typing import Any

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.arrays import Floats, Ints, Longs
from perfplast_fenicsx.compiled_kernels import aligned, compiled
from perfplast_fenicsx.limit_analysis.conic.cone import Moduli
from perfplast_fenicsx.limit_analysis.conic.discretisation import (
    NONE,
    SingularStiffness,
    SprungMatrix,
)
from perfplast_fenicsx.limit_analysis.discrete.friction_points import Springs
from perfplast_fenicsx.limit_analysis.stress.multiplier_strains import MultiplierStrains
from perfplast_fenicsx.profiling import phase
from perfplast_fenicsx.solvers.linear.factorisation import DIRECT


def source() -> str:
    """Return the C source of the functions ``condense``, ``push_out`` and ``bring_in``."""
    return r"""
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#define LEAST 1e-13 /* as RIDGE */
#define LANES 4 /* number of cells treated at once; equal entries are adjacent */
typedef double lanes __attribute__((vector_size(8 * LANES), may_alias));

static lanes *room_for(int count) {
  return aligned_alloc(64, sizeof(lanes) * (size_t)(count + count % 2));
}

static lanes roots_of(lanes a) {
  for (int l = 0; l < LANES; ++l) a[l] = sqrt(a[l]);
  return a;
}

/* subtract from p and q the products of the first n columns of x and y with rows a, b, c, d */
static inline void less_products(lanes *restrict p, lanes *restrict q, const lanes *a,
                                 const lanes *b, const lanes *c, const lanes *d,
                                 const lanes *x, const lanes *y, int n) {
  lanes p0 = p[0], p1 = p[1], p2 = p[2], p3 = p[3];
  lanes q0 = q[0], q1 = q[1], q2 = q[2], q3 = q[3];
  for (int k = 0; k < n; ++k) {
    lanes u = x[k], v = y[k];
    p0 -= u * a[k], p1 -= u * b[k], p2 -= u * c[k], p3 -= u * d[k];
    q0 -= v * a[k], q1 -= v * b[k], q2 -= v * c[k], q3 -= v * d[k];
  }
  p[0] = p0, p[1] = p1, p[2] = p2, p[3] = p3;
  q[0] = q0, q[1] = q1, q[2] = q2, q[3] = q3;
}

/* Eliminate the first n rows of symmetric matrices for all cells at once. The rows contain the
   lower triangles. In very flat cells, rounding may make a pivot negative; no pivot is less than
   LEAST times its entry before the elimination. Return whether the elimination failed. */
static int eliminate(lanes **row, int n, int all) {
  int failed = 0;
  for (int j = 0; j < n; j += 4) {
    int w = n - j < 4 ? n - j : 4;
    for (int i = j; i < j + w; ++i)
      for (int m = j; m <= i; ++m) {
        lanes sum = row[i][m];
        for (int k = 0; k < m; ++k) sum -= row[i][k] * row[m][k];
        if (m < i)
          row[i][m] = sum * row[m][m]; /* the diagonal stores inverses */
        else {
          for (int l = 0; l < LANES; ++l) {
            double least = LEAST * row[i][i][l];
            if (!(sum[l] > least)) sum[l] = least;
            failed |= !(sum[l] > 0);
          }
          row[i][i] = 1.0 / roots_of(sum);
        }
      }
    int i = j + w;
    if (w == 4)
      for (; i + 1 < all; i += 2) {
        lanes *p = row[i] + j, *q = row[i + 1] + j;
        less_products(p, q, row[j], row[j + 1], row[j + 2], row[j + 3], row[i], row[i + 1], j);
        for (int m = 0; m < 4; ++m) {
          lanes u = p[m], v = q[m];
          for (int k = 0; k < m; ++k) u -= p[k] * row[j + m][j + k], v -= q[k] * row[j + m][j + k];
          p[m] = u * row[j + m][j + m], q[m] = v * row[j + m][j + m];
        }
      }
    for (; i < all; ++i)
      for (int m = j; m < j + w; ++m) {
        lanes sum = row[i][m];
        for (int k = 0; k < m; ++k) sum -= row[i][k] * row[m][k];
        row[i][m] = sum * row[m][m];
      }
  }
  return failed;
}

int condense(int64_t cells, int points, int rows, int parts, int outer, int inner,
             const int64_t *at, const double *matrices, const double *roots,
             const double *more, const double *ridge, double *factors, double *left) {
  const int all = inner + outer, tri = inner * (inner + 1) / 2;
  const size_t entries = tri + (size_t)outer * inner;
  lanes *S = room_for(outer * (outer + 4));
  lanes *B = room_for(2 * rows * parts + parts * parts);
  int *to = malloc(sizeof(int) * (size_t)(points * rows + all));
  lanes **row = malloc(sizeof(lanes *) * (size_t)all);
  int failed = 0;
  for (int k = 0; k < points * rows; ++k)
    to[k] = at[k] < outer ? (int)at[k] + inner : (int)at[k] - outer;
  for (int64_t first = 0; first < cells; first += LANES) {
    lanes *L = (lanes *)(factors + first * entries);
    int64_t cell[LANES];
    for (int l = 0; l < LANES; ++l) cell[l] = first + l < cells ? first + l : cells - 1;
    for (int i = 0; i < inner; ++i) row[i] = L + i * (i + 1) / 2;
    for (int i = 0; i < outer; ++i) row[inner + i] = L + tri + i * inner;
    memset(L, 0, sizeof(lanes) * entries);
    memset(S, 0, sizeof(lanes) * (size_t)(outer * (outer + 4)));
    for (int p = 0; p < points; ++p) {
      lanes *M = B, *R = B + rows * parts, *P = R + parts * parts;
      const int *here = to + p * rows;
      for (int l = 0; l < LANES; ++l) {
        const double *from = matrices + (cell[l] * points + p) * rows * parts;
        for (int k = 0; k < rows * parts; ++k) ((double *)(M + k))[l] = from[k];
        from = roots + (cell[l] * points + p) * parts * parts;
        for (int k = 0; k < parts * parts; ++k) ((double *)(R + k))[l] = from[k];
      }
      for (int i = 0; i < rows; ++i)
        for (int j = 0; j < parts; ++j) {
          lanes sum = M[i * parts] * R[j];
          for (int k = 1; k < parts; ++k) sum += M[i * parts + k] * R[k * parts + j];
          P[i * parts + j] = sum;
        }
      for (int i = 0; i < rows; ++i)
        for (int j = 0; j <= i; ++j) {
          lanes sum = P[i * parts] * P[j * parts];
          for (int k = 1; k < parts; ++k) sum += P[i * parts + k] * P[j * parts + k];
          int r = here[i] > here[j] ? here[i] : here[j], c = here[i] + here[j] - r;
          if (c < inner)
            row[r][c] += sum;
          else
            S[(r - inner) * (outer + 4) + c - inner] += sum;
        }
    }
    for (int l = 0; l < LANES; ++l) {
      for (int i = 0; i < inner; ++i) ((double *)(row[i] + i))[l] += more[cell[l] * inner + i];
      for (int i = 0; i < outer; ++i)
        ((double *)(S + i * (outer + 5)))[l] *= 1 + ridge[cell[l]];
    }
    failed |= eliminate(row, inner, all);
    for (int i = 0; i < outer; i += 2) {
      int last = i + 1 < outer ? i + 1 : i, j = 0;
      lanes *p = S + i * (outer + 4), *q = S + last * (outer + 4);
      if (last > i)
        for (; j + 3 <= last && j + 3 < outer; j += 4)
          less_products(p + j, q + j, row[inner + j], row[inner + j + 1], row[inner + j + 2],
                        row[inner + j + 3], row[inner + i], row[inner + last], inner);
      for (int m = i; m <= last; ++m)
        for (int c = j; c <= m; ++c) {
          lanes sum = S[m * (outer + 4) + c];
          for (int k = 0; k < inner; ++k) sum -= row[inner + m][k] * row[inner + c][k];
          S[m * (outer + 4) + c] = sum;
        }
    }
    for (int l = 0; l < LANES && first + l < cells; ++l) {
      double *out = left + (first + l) * outer * outer;
      for (int i = 0; i < outer; ++i)
        for (int j = 0; j <= i; ++j)
          out[i * outer + j] = out[j * outer + i] = S[i * (outer + 4) + j][l];
    }
  }
  free(S), free(B), free(to), free(row);
  return failed;
}

/* Condense the forces on inner unknowns: write L^-1 times these forces to half, and their effect on
   the outer unknowns to onto. */
void push_out(int64_t cells, int outer, int inner, const double *factors, const double *forces,
              double *half, double *onto) {
  const int tri = inner * (inner + 1) / 2;
  const size_t entries = tri + (size_t)outer * inner;
  for (int64_t first = 0; first < cells; first += LANES) {
    const lanes *L = (const lanes *)(factors + first * entries), *A = L + tri;
    lanes *x = (lanes *)(half + first * inner);
    int here = cells - first < LANES ? (int)(cells - first) : LANES;
    memset(x, 0, sizeof(lanes) * (size_t)inner);
    for (int l = 0; l < here; ++l)
      for (int i = 0; i < inner; ++i) ((double *)(x + i))[l] = forces[(first + l) * inner + i];
    for (int i = 0; i < inner; ++i, L += i) {
      lanes sum = x[i];
      for (int k = 0; k < i; ++k) sum -= L[k] * x[k];
      x[i] = sum * L[i];
    }
    for (int i = 0; i < outer; ++i, A += inner) {
      lanes sum = A[0] * x[0];
      for (int k = 1; k < inner; ++k) sum += A[k] * x[k];
      for (int l = 0; l < here; ++l) onto[(first + l) * outer + i] = -sum[l];
    }
  }
}

/* Return the inner unknowns from the outer unknowns and from half, the result of push_out. */
void bring_in(int64_t cells, int outer, int inner, const double *factors, double *half,
              const double *known, double *found) {
  const int tri = inner * (inner + 1) / 2;
  const size_t entries = tri + (size_t)outer * inner;
  for (int64_t first = 0; first < cells; first += LANES) {
    const lanes *L = (const lanes *)(factors + first * entries), *A = L + tri;
    lanes *x = (lanes *)(half + first * inner);
    int here = cells - first < LANES ? (int)(cells - first) : LANES;
    for (int i = 0; i < outer; ++i, A += inner) {
      lanes y = {0};
      for (int l = 0; l < here; ++l) y[l] = known[(first + l) * outer + i];
      for (int k = 0; k < inner; ++k) x[k] -= A[k] * y;
    }
    for (int i = inner - 1; i >= 0; --i) {
      const lanes *of = L + i * (i + 1) / 2;
      x[i] *= of[i];
      for (int k = 0; k < i; ++k) x[k] -= of[k] * x[i];
    }
    for (int l = 0; l < here; ++l)
      for (int i = 0; i < inner; ++i) found[(first + l) * inner + i] = x[i][l];
  }
}
"""


class CellCondensation:
    """The factor L of the inner block of each cell's K, and L⁻¹ times the coupling block."""

    def __init__(self, comm: MPI.Intracomm, rows: Longs, matrices: Floats, outer: int) -> None:
        """Compile the kernels and allocate arrays. Collective.

        Args:
            comm: The ranks.
            rows: Index of the cell unknown of each row at each point, shape (num_points, n). Outer
                unknowns have the first indices, and each inner unknown occurs in at least one row.
            matrices: Matrices of the points, shape (num_cells, num_points, n, 1 + m).
            outer: Number of outer unknowns, which remain after the elimination.
        """
        self._rows = np.ascontiguousarray(rows, dtype=np.int64)
        self._matrices = np.ascontiguousarray(matrices)
        inner = int(rows.max()) + 1 - outer
        self._sizes = outer, inner
        self._kernels, self._ffi = compiled(comm, source())
        at_once = 4  # cells that the kernels process at once
        padded = -(-len(matrices) // at_once) * at_once
        self._factors = aligned(padded * (inner * (inner + 1) // 2 + outer * inner))
        self._half = aligned(padded * inner)

    def condense(self, roots: Floats, more: Floats, ridge: Floats) -> tuple[Floats, bool]:
        """Eliminate the inner unknowns from Σ (Bᵀ R)(Bᵀ R)ᵀ with the points' matrices Bᵀ.

        Args:
            roots: Roots R of the moduli times weights, shape (num_cells, num_points, 1 + m, 1 + m).
            more: Additional diagonal of the inner unknowns, shape (num_cells, inner).
            ridge: Share by which the diagonal of the outer unknowns increases, shape (num_cells,).

        Returns:
            The condensed matrix of the outer unknowns, shape (num_cells, outer, outer); whether the
            elimination succeeded.
        """
        count, outer = len(self._matrices), self._sizes[0]
        left = np.empty((count, outer, outer))
        failed = self._kernels.condense(
            *self._matrices.shape,
            *self._sizes,
            self._ffi.from_buffer("int64_t[]", self._rows),
            *map(self._given, (self._matrices, roots, more, ridge)),
            *map(self._taken, (self._factors, left)),
        )
        return left, failed == 0

    def push_out(self, forces: Floats) -> Floats:
        """Return the equivalent forces on outer unknowns, shape (num_cells, outer).

        Args:
            forces: Forces on the inner unknowns, shape (num_cells, inner); the next
                :meth:`bring_in` also uses these forces.
        """
        onto = np.empty((len(forces), self._sizes[0]))
        self._kernels.push_out(
            len(forces),
            *self._sizes,
            *map(self._given, (self._factors, forces)),
            *map(self._taken, (self._half, onto)),
        )
        return onto

    def bring_in(self, outer: Floats) -> Floats:
        """Return the inner unknowns for outer unknowns and the last forces of :meth:`push_out`.

        Args:
            outer: Outer unknowns, shape (num_cells, outer).
        """
        found = np.empty((len(outer), self._sizes[1]))
        self._kernels.bring_in(
            len(outer),
            *self._sizes,
            self._given(self._factors),
            self._taken(self._half),
            self._given(outer),
            self._taken(found),
        )
        return found

    def _given(self, array: Floats) -> Any:
        return self._ffi.from_buffer("double[]", np.ascontiguousarray(array, dtype=np.float64))

    def _taken(self, array: Floats) -> Any:
        return self._ffi.from_buffer("double[]", array, require_writable=True)


RIDGE = 1e-13
"""Fraction of the diagonal of K that is added to K, because rows of equilibrium may be linearly
dependent where facets meet at right angles or cross.
"""


class CondensedStiffness(SprungMatrix):
    """Stiffness K of multipliers; see :class:`discretisation.Stiffness`."""

    def __init__(self, strains: MultiplierStrains, held: Ints, jumps: Ints) -> None:
        """Compute the sparsity pattern. Collective.

        Args:
            strains: Strain rates of the multipliers.
            held: Owned facet unknowns that supports hold.
            jumps: Owned facet unknowns that are jumps of contact.
        """
        self._strains, self._held, self._out = strains, held, held
        facets, layout = strains.facets, strains.layout
        self._springs: Springs | None = None
        matrix = PETSc.Mat().create(facets.vector.comm)
        matrix.setType(PETSc.Mat.Type.AIJ)
        # K is positive semidefinite, so pivoting in MUMPS would cost memory and time without a
        # benefit.
        unpivoted = {**DIRECT, "mat_mumps_cntl_1": 0.0}
        super().__init__(facets.vector.comm, matrix, jumps, unpivoted)
        self._preallocate()
        comm = facets.vector.comm.tompi4py()
        self._cells = CellCondensation(comm, strains.rows, strains.matrices, layout.outer)
        self._right, self._found = self._matrix.createVecs()

    def destroy(self) -> None:
        """Free PETSc's memory. Collective."""
        super().destroy()
        for vector in (self._right, self._found):
            vector.destroy()

    def _preallocate(self) -> None:
        """Preallocate the entries of cells, of the twins of jumps, and of rigid surfaces.

        Collective.
        """
        facets, block = self._strains.facets, self._strains.gdim
        numbers = facets.numbers[facets.of_cells].astype(PETSc.IntType)
        twins = facets.twins[facets.of_cells].astype(PETSc.IntType)
        self._blocks = np.ascontiguousarray(numbers[:, ::block] // block)
        self._coupled = np.flatnonzero((twins >= 0).any(axis=1))
        self._numbers, self._twins = numbers[self._coupled], twins[self._coupled]
        at = facets.followers
        kept = at.keep > 0
        self._leads = np.broadcast_to(at.leads, (len(at.cells), len(at.leads)))
        self._leads = np.ascontiguousarray(self._leads, dtype=PETSc.IntType)
        self._beside = [
            np.where(kept, of[at.cells], -1).astype(PETSc.IntType) for of in (numbers, twins)
        ]
        room = PETSc.Mat().create(self._matrix.comm)
        room.setType(PETSc.Mat.Type.PREALLOCATOR)
        for matrix in (room, self._matrix):
            matrix.setSizes(((facets.count, None), (facets.count, None)), bsize=block)
        room.setUp()
        self._fill(room, np.zeros((len(numbers), *2 * numbers.shape[1:])))
        room.preallocatorPreallocate(self._matrix)
        room.destroy()

    def _fill(self, matrix: PETSc.Mat, values: Floats) -> None:
        """Add the matrices of cells, shape (num_cells, outer, outer), to a matrix. Collective."""
        add, at = PETSc.InsertMode.ADD, self._strains.facets.followers
        led = values[at.cells] @ at.shares
        values[at.cells] *= at.keep[:, :, None] * at.keep[:, None]
        matrix.setValuesBlockedRCV(self._blocks, self._blocks, values, addv=add)
        numbers, twins, there = self._numbers, self._twins, values[self._coupled]
        for rows, columns in ((numbers, twins), (twins, numbers), (twins, twins)):
            matrix.setValuesRCV(rows, columns, there, addv=add)
        if len(at.leads):
            shares, across = np.swapaxes(at.shares, 1, 2), np.ascontiguousarray(led.swapaxes(1, 2))
            for beside in self._beside:
                matrix.setValuesRCV(beside, self._leads, led, addv=add)
                matrix.setValuesRCV(self._leads, beside, across, addv=add)
            matrix.setValuesRCV(self._leads, self._leads, shares @ led, addv=add)
        matrix.assemble()

    def add_springs(self, springs: Springs) -> None:
        """Set springs at facet unknowns of single vertices; later assemblies add the springs."""
        self._springs = springs

    def check_memory(self) -> None:
        """Check from the sparsity pattern of K that its factors fit into memory. Collective.

        Raises:
            TooLarge: If the factors do not fit; the message gives the needed and the available
                memory.
        """
        outer = self._strains.layout.outer
        pattern = 1.0  # any value, since only the pattern matters
        everywhere = np.full((self._strains.num_cells, outer, outer), pattern)
        self._matrix.zeroEntries()
        self._fill(self._matrix, everywhere)
        self.check_once()

    @phase("assembly")
    def assemble(self, moduli: Moduli, held: Ints = NONE) -> None:
        """Assemble K with moduli at the points of this rank. Collective.

        Raises:
            SingularStiffness: If the inner unknowns of a cell cannot be eliminated.
        """
        strains = self._strains
        roots = moduli.roots() * np.sqrt(strains.weights)[:, None, None]
        # in cells with few stresses, the eliminated rows may already imply the rows of facets
        ridge: Floats = RIDGE * strains.few.astype(np.float64)
        idle: Floats = strains.idle[:, strains.layout.outer :].astype(np.float64)
        values, done = self._cells.condense(roots, idle, ridge)
        if strains.facets.vector.comm.tompi4py().allreduce(not done):
            raise SingularStiffness("the equilibrium of a cell cannot be solved for its stress")
        self._matrix.zeroEntries()
        self._fill(self._matrix, values)
        if self._springs is not None:
            index, stiffness = self._springs
            first = self._matrix.getOwnershipRange()[0]
            numbers = np.where(index >= 0, index + first, -1).astype(PETSc.IntType)
            self._matrix.setValuesRCV(numbers, numbers, stiffness, addv=PETSc.InsertMode.ADD)
            self._matrix.assemble()
        diagonal = self._matrix.getDiagonal()
        diagonal.scale(1 + RIDGE)
        diagonal.array[self._held] = 1.0
        self._matrix.setDiagonal(diagonal)
        diagonal.destroy()
        self._out = np.union1d(self._held, held)
        if strains.facets.vector.comm.tompi4py().allreduce(len(held)):
            self._matrix.zeroRowsColumns(strains.facets.numbers[held].astype(PETSc.IntType))

    @phase("linear solve")
    def solve(self, b: PETSc.Vec, x: PETSc.Vec) -> None:
        """Solve K x = b with the last factors. Collective."""
        strains, count = self._strains, self._strains.facets.count
        onto = self._cells.push_out(strains.inner(b.array_r))
        self._right.array[:] = b.array_r[:count] + strains.facets.add_up(onto)
        self._right.array[self._out] = 0.0
        super().solve(self._right, self._found)
        outer = strains.facets.gather(self._found.array_r)
        array = x.array
        array[:count] = self._found.array_r
        array[count:] = self._cells.bring_in(outer).ravel()
