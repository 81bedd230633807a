"""C source of products with blocks (:mod:`blocked_products`), in single or double precision.

Blocks are kept row by row, and vectors with room for as many entries as are worked on at once: what
is loaded beyond a row is multiplied with zeros or put where nobody looks. Of a symmetric matrix
blocks of the upper triangle are kept, the one on the diagonal first in each row of them; of others
all.
"""

from petsc4py import PETSc

import numpy as np


def sizes() -> tuple[int, ...]:
    """Of the blocks that there are: unknowns of a node, motions of an aggregate."""
    return 2, 3, 4, 6, 7


def source(precision: type[np.floating]) -> str:
    """Functions count, pattern, fill, product, add, take and give.

    Args:
        precision: Of what is kept and multiplied, float32 or float64.
    """
    real = {np.float32: "float", np.float64: "double"}[precision]
    products = "".join(
        _products().replace("_WIDTH", f"_{width}").replace("LANES", f"{width}") for width in (4, 8)
    )
    whole = f"int{8 * np.dtype(PETSc.IntType).itemsize}_t"
    return (_entries() + products + _calls()).replace("INDEX", whole).replace("REAL", real)


def _entries() -> str:
    return r"""
#include <stdint.h>
#include <string.h>

#define OWN static inline __attribute__((always_inline))

/* columns of blocks in a row of blocks, which are marked with the row's number; returns how many */
OWN int64_t columns_(const int n, int64_t row, int upper, const INDEX *start, const INDEX *column,
                     int64_t *mark, int32_t *found) {
  int64_t count = 0;
  if (upper) {
    mark[row] = row + 1;
    if (found) found[0] = (int32_t)row;
    count = 1;
  }
  for (int64_t e = start[n * row]; e < start[n * row + n]; ++e) {
    int64_t c = column[e] / n;
    if ((upper && c < row) || mark[c] == row + 1) continue;
    mark[c] = row + 1;
    if (found) found[count] = (int32_t)c;
    ++count;
  }
  return count;
}

OWN void count_(const int n, int64_t rows, int upper, const INDEX *start, const INDEX *column,
                int64_t *mark, int64_t *first) {
  first[0] = 0;
  for (int64_t r = 0; r < rows; ++r)
    first[r + 1] = first[r] + columns_(n, r, upper, start, column, mark, 0);
}

OWN void pattern_(const int n, int64_t rows, int upper, const INDEX *start, const INDEX *column,
                  int64_t *mark, const int64_t *first, int32_t *block) {
  for (int64_t r = 0; r < rows; ++r)
    columns_(n, r, upper, start, column, mark, block + first[r]);
}

OWN void fill_(const int n, int64_t rows, int upper, const INDEX *start, const INDEX *column,
               const double *value, int64_t *place, const int64_t *first, const int32_t *block,
               REAL *kept) {
  memset(kept, 0, sizeof(REAL) * n * n * (size_t)first[rows]);
  for (int64_t r = 0; r < rows; ++r) {
    for (int64_t b = first[r]; b < first[r + 1]; ++b) place[block[b]] = b;
    for (int i = 0; i < n; ++i)
      for (int64_t e = start[n * r + i]; e < start[n * r + i + 1]; ++e) {
        int64_t c = column[e] / n;
        if (upper && c < r) continue;
        kept[n * n * place[c] + n * i + column[e] - n * c] = (REAL)value[e];
      }
  }
}

/* places of a vector with so many entries; those beyond a block's are zero, or of no use */
#define WIDTH(n) ((n) > 4 ? 8 : 4)
"""


def _products() -> str:
    return r"""
typedef REAL lanes_WIDTH __attribute__((vector_size(sizeof(REAL) * LANES)));

OWN void rows_WIDTH(const int n, const REAL *A, const REAL *z, lanes_WIDTH *sum) {
  lanes_WIDTH row, given;
  memcpy(&given, z, sizeof given);
  for (int i = 0; i < n; ++i) {
    memcpy(&row, A + n * i, sizeof row);
    sum[i] += row * given;
  }
}

OWN void both_WIDTH(const int n, const REAL *A, const REAL *z, const REAL *own,
                     lanes_WIDTH *sum, REAL *other) {
  lanes_WIDTH row, given, taken;
  memcpy(&given, z, sizeof given);
  memcpy(&taken, other, sizeof taken);
  for (int i = 0; i < n; ++i) {
    memcpy(&row, A + n * i, sizeof row);
    sum[i] += row * given;
    taken += row * own[i];
  }
  memcpy(other, &taken, sizeof taken);
}

OWN void put_WIDTH(const int n, const lanes_WIDTH *sum, REAL *y) {
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) y[i] += sum[i][j];
}

OWN void product_WIDTH(const int n, int64_t rows, const int64_t *first,
                        const int32_t *block, const REAL *kept, const REAL *x, REAL *y) {
  for (int64_t r = 0; r < rows; ++r) {
    lanes_WIDTH sum[8] = {0};
    REAL own[8];
    for (int i = 0; i < n; ++i) own[i] = x[LANES * r + i];
    const REAL *A = kept + n * n * first[r];
    rows_WIDTH(n, A, x + LANES * r, sum);
    for (int64_t b = first[r] + 1; b < first[r + 1]; ++b) {
      A += n * n;
      both_WIDTH(n, A, x + LANES * (int64_t)block[b], own, sum,
                  y + LANES * (int64_t)block[b]);
    }
    put_WIDTH(n, sum, y + LANES * r);
  }
}

OWN void add_WIDTH(const int n, int64_t rows, const int64_t *first, const int32_t *block,
                    const REAL *kept, const REAL *x, REAL *y) {
  for (int64_t r = 0; r < rows; ++r) {
    lanes_WIDTH sum[8] = {0};
    for (int64_t b = first[r]; b < first[r + 1]; ++b)
      rows_WIDTH(n, kept + n * n * b, x + LANES * (int64_t)block[b], sum);
    put_WIDTH(n, sum, y + LANES * r);
  }
}
"""


def _calls() -> str:
    return r"""
OWN void product_(const int n, int64_t rows, const int64_t *first, const int32_t *block,
                  const REAL *kept, const REAL *x, REAL *y) {
  memset(y, 0, sizeof(REAL) * WIDTH(n) * (size_t)rows);
  if (WIDTH(n) == 4) product_4(n, rows, first, block, kept, x, y);
  else product_8(n, rows, first, block, kept, x, y);
}

OWN void add_(const int n, int64_t rows, const int64_t *first, const int32_t *block,
              const REAL *kept, const REAL *x, REAL *y) {
  if (WIDTH(n) == 4) add_4(n, rows, first, block, kept, x, y);
  else add_8(n, rows, first, block, kept, x, y);
}

OWN void take_(const int n, int64_t rows, const double *given, REAL *x) {
  for (int64_t r = 0; r < rows; ++r)
    for (int i = 0; i < n; ++i) x[WIDTH(n) * r + i] = (REAL)given[n * r + i];
}

OWN void give_(const int n, int64_t rows, const REAL *y, double *taken) {
  for (int64_t r = 0; r < rows; ++r)
    for (int i = 0; i < n; ++i) taken[n * r + i] = y[WIDTH(n) * r + i];
}

#define FOR_SIZE(function, ...)                   \
  switch (n) {                                    \
    case 2: function(2, __VA_ARGS__); break;      \
    case 3: function(3, __VA_ARGS__); break;      \
    case 4: function(4, __VA_ARGS__); break;      \
    case 6: function(6, __VA_ARGS__); break;      \
    case 7: function(7, __VA_ARGS__); break;      \
  }

void count(int n, int64_t rows, int upper, const INDEX *start, const INDEX *column, int64_t *mark,
           int64_t *first) {
  FOR_SIZE(count_, rows, upper, start, column, mark, first)
}

void pattern(int n, int64_t rows, int upper, const INDEX *start, const INDEX *column, int64_t *mark,
             const int64_t *first, int32_t *block) {
  FOR_SIZE(pattern_, rows, upper, start, column, mark, first, block)
}

void fill(int n, int64_t rows, int upper, const INDEX *start, const INDEX *column,
          const double *value, int64_t *place, const int64_t *first, const int32_t *block,
          REAL *kept) {
  FOR_SIZE(fill_, rows, upper, start, column, value, place, first, block, kept)
}

void product(int n, int64_t rows, const int64_t *first, const int32_t *block, const REAL *kept,
             const REAL *x, REAL *y) {
  FOR_SIZE(product_, rows, first, block, kept, x, y)
}

void add(int n, int64_t rows, const int64_t *first, const int32_t *block, const REAL *kept,
         const REAL *x, REAL *y) {
  FOR_SIZE(add_, rows, first, block, kept, x, y)
}

void take(int n, int64_t rows, const double *given, REAL *x) {
  FOR_SIZE(take_, rows, given, x)
}

void give(int n, int64_t rows, const REAL *y, double *taken) {
  FOR_SIZE(give_, rows, y, taken)
}
"""
