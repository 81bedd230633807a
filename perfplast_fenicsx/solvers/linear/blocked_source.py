"""Generate the C source of products with blocks (:mod:`blocked_products`), in either precision.

Vectors are padded to the vector width. Entries loaded beyond a row are multiplied with zeros or
stored in the padding. A symmetric matrix is stored as the blocks of its upper triangle, with the
diagonal block first in each row.
"""

import numpy as np

from perfplast_fenicsx.solvers.linear.block_rows_source import for_size, own_types


def source(precision: type[np.floating]) -> str:
    """Return the functions product, add, take and give.

    Args:
        precision: Precision of storage and products, float32 or float64.
    """
    products = "".join(
        _products().replace("_WIDTH", f"_{width}").replace("LANES", f"{width}") for width in (4, 8)
    )
    return own_types(products + for_size("n") + _calls(), precision)


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
/* places of a vector with so many entries; those beyond a block's are zero, or of no use */
#define WIDTH(n) ((n) > 4 ? 8 : 4)

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
