"""Generate the C source that sums cells' stiffness matrices (:mod:`body_stiffness`).

The kernel works on four cells at once, with corresponding entries of the four side by side. So the
vector instructions of any processor are used.
"""


def source() -> str:
    """Return the source of the function ``body_sums``."""
    return r"""
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#define LANES 4 /* cells at once, an entry of each side by side */
typedef double lanes __attribute__((vector_size(8 * LANES), may_alias));
#define OWN static inline __attribute__((always_inline))

/* P = M R of a point, of all four cells */
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

/* add a cell's matrix, whose lower half S holds, to the blocks of its nodes */
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

/* Σ (M R)(M R)ᵀ over the points of each cell; M of four cells side by side, zero beyond the last */
void body_sums(int64_t cells, int points, int nodes, int dim, int parts, const double *matrices,
               const double *roots, const int32_t *place, int64_t blocks, double *sums) {
  const int unknowns = dim * nodes, all = points * parts, square = parts * parts;
  const int width = unknowns + 4; /* as tiles may reach beyond the last row and column */
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
