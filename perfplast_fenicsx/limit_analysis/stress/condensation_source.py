"""Generate the C source that eliminates cells' inner unknowns (:mod:`cell_condensation`).

The kernel works on four cells at once, with corresponding entries of the four side by side. So the
vector instructions of any processor are used. Inner unknowns come first in the rows, and the
diagonal of L is kept inverted.
"""


def source() -> str:
    """Return the source of the functions ``condense``, ``push_out`` and ``bring_in``."""
    return r"""
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#define LANES 4 /* cells at once, an entry of each side by side */
typedef double lanes __attribute__((vector_size(8 * LANES), may_alias));

static lanes *room_for(int count) {
  return aligned_alloc(64, sizeof(lanes) * (size_t)(count + count % 2));
}

static lanes roots_of(lanes a) {
  for (int l = 0; l < LANES; ++l) a[l] = sqrt(a[l]);
  return a;
}

/* rows p and q less what columns before n of rows a, b, c, d have in common with them */
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

/* Eliminate the first n of all rows of a symmetric matrix whose lower half they hold, of all cells
   side by side; returns whether any of these cannot be. */
static int eliminate(lanes **row, int n, int all) {
  int failed = 0;
  for (int j = 0; j < n; j += 4) {
    int w = n - j < 4 ? n - j : 4;
    for (int i = j; i < j + w; ++i)
      for (int m = j; m <= i; ++m) {
        lanes sum = row[i][m];
        for (int k = 0; k < m; ++k) sum -= row[i][k] * row[m][k];
        if (m < i)
          row[i][m] = sum * row[m][m]; /* inverses are kept on the diagonal */
        else {
          for (int l = 0; l < LANES; ++l) failed |= !(sum[l] > 0);
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

/* What forces inside cells leave on the outer unknowns; they become L^-1 times what they were. */
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

/* The inner unknowns, from what push_out has left of their forces and the outer ones. */
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
