"""Generate the C source of blocks of compressed rows (:mod:`block_rows`), in either precision."""

from petsc4py import PETSc

import numpy as np


def sizes() -> tuple[int, ...]:
    """Return the supported block sizes: unknowns of a node, motions of an aggregate."""
    return 2, 3, 4, 6, 7


def for_size(of: str) -> str:
    """Return a macro that calls a function with the size in a variable as a constant.

    Args:
        of: The variable.
    """
    cases = (f"case {size}: function({size}, __VA_ARGS__); break;" for size in sizes())
    return f"#define FOR_SIZE(function, ...) switch ({of}) {{ {' '.join(cases)} }}\n"


def own_types(text: str, precision: type[np.floating]) -> str:
    """Return a source with PETSc's integers for INDEX, and REAL for the stored precision."""
    whole = f"int{8 * np.dtype(PETSc.IntType).itemsize}_t"
    real = {np.float32: "float", np.float64: "double"}[precision]
    head = r"""
#include <stdint.h>
#include <string.h>

#define OWN static inline __attribute__((always_inline))
"""
    return head + text.replace("INDEX", whole).replace("REAL", real)


def source(precision: type[np.floating]) -> str:
    """Return functions ``pattern`` and ``fill`` for blocks with n rows and m columns.

    Args:
        precision: Precision of what is kept, float32 or float64.
    """
    return own_types(_kernels() + for_size("n") + _calls(), precision)


def _kernels() -> str:
    return r"""
/* where the blocks of each row of blocks begin, and, where it is known how many there are, their
   columns of blocks; of a symmetric matrix those of the upper triangle, the diagonal's first */
OWN void pattern_(const int n, const int m, int64_t rows, int upper, const INDEX *start,
                  const INDEX *column, int64_t *mark, int64_t *first, int known, int32_t *block) {
  int64_t count = 0;
  for (int64_t r = 0; r < rows; ++r) {
    first[r] = count;
    if (upper) {
      mark[r] = r + 1;
      if (known) block[count] = (int32_t)r;
      ++count;
    }
    for (int64_t e = start[n * r]; e < start[n * r + n]; ++e) {
      int64_t c = column[e] / m;
      if ((upper && c < r) || mark[c] == r + 1) continue;
      mark[c] = r + 1;
      if (known) block[count] = (int32_t)c;
      ++count;
    }
  }
  first[rows] = count;
}

/* returns how many entries have no block */
OWN int64_t fill_(const int n, const int m, int64_t rows, int64_t columns, int upper,
                  const INDEX *start, const INDEX *column, const double *value, int64_t *place,
                  const int64_t *first, const int32_t *block, REAL *kept) {
  int64_t astray = 0;
  memset(kept, 0, sizeof(REAL) * n * m * (size_t)first[rows]);
  for (int64_t c = 0; c < columns; ++c) place[c] = -1;
  for (int64_t r = 0; r < rows; ++r) {
    for (int64_t b = first[r]; b < first[r + 1]; ++b) place[block[b]] = b;
    for (int i = 0; i < n; ++i)
      for (int64_t e = start[n * r + i]; e < start[n * r + i + 1]; ++e) {
        int64_t c = column[e] / m;
        if (upper && c < r) continue;
        int64_t b = c < columns ? place[c] : -1;
        if (b < first[r]) ++astray;  /* a row before had the column, or none */
        else kept[n * m * b + m * i + column[e] - m * c] = (REAL)value[e];
      }
  }
  return astray;
}

#define SQUARE(n, ...) found = fill_(n, n, __VA_ARGS__)
"""


def _calls() -> str:
    return r"""
void pattern(int n, int m, int64_t rows, int64_t columns, int upper, const INDEX *start,
             const INDEX *column, int64_t *mark, int64_t *first, int known, int32_t *block) {
  pattern_(n, m, rows, upper, start, column, mark, first, known, block);
}

int64_t fill(int n, int m, int64_t rows, int64_t columns, int upper, const INDEX *start,
             const INDEX *column, const double *value, int64_t *place, const int64_t *first,
             const int32_t *block, REAL *kept) {
  int64_t found = -1;
  if (n == m) {
    FOR_SIZE(SQUARE, rows, columns, upper, start, column, value, place, first, block, kept)
  } else {
    found = fill_(n, m, rows, columns, upper, start, column, value, place, first, block, kept);
  }
  return found;
}
"""
