"""Generate the C source of interpolations in single precision (:mod:`blocked_interpolation`).

Coarse vectors are padded to the vector width. Entries loaded beyond a row are multiplied with zeros
or stored in the padding.
"""

import numpy as np

from perfplast_fenicsx.solvers.linear.block_rows_source import for_size, own_types


def source() -> str:
    """Return the functions ``interpolate`` and ``restrict_``."""
    products = "".join(
        _products().replace("_WIDTH", f"_{width}").replace("LANES", f"{width}") for width in (4, 8)
    )
    return own_types(products + for_size("fine") + _calls(), np.float32)


def _products() -> str:
    return r"""
typedef float lanes_WIDTH __attribute__((vector_size(4 * LANES)));

OWN void interpolate_WIDTH(const int fine, int coarse, int64_t rows, const int64_t *first,
                           const int32_t *block, const float *kept, const float *x, double *y) {
  for (int64_t r = 0; r < rows; ++r) {
    lanes_WIDTH sum[8] = {0}, row, given;
    for (int64_t b = first[r]; b < first[r + 1]; ++b) {
      const float *A = kept + fine * coarse * b;
      memcpy(&given, x + LANES * (int64_t)block[b], sizeof given);
      for (int i = 0; i < fine; ++i) {
        memcpy(&row, A + coarse * i, sizeof row);
        sum[i] += row * given;
      }
    }
    for (int i = 0; i < fine; ++i) {
      float all = 0;
      for (int j = 0; j < coarse; ++j) all += sum[i][j];
      y[fine * r + i] += all;
    }
  }
}

OWN void restrict_WIDTH(const int fine, int coarse, int64_t rows, const int64_t *first,
                        const int32_t *block, const float *kept, const double *x, float *y) {
  for (int64_t r = 0; r < rows; ++r) {
    float own[8];
    for (int i = 0; i < fine; ++i) own[i] = (float)x[fine * r + i];
    for (int64_t b = first[r]; b < first[r + 1]; ++b) {
      const float *A = kept + fine * coarse * b;
      lanes_WIDTH row, taken;
      memcpy(&taken, y + LANES * (int64_t)block[b], sizeof taken);
      for (int i = 0; i < fine; ++i) {
        memcpy(&row, A + coarse * i, sizeof row);
        taken += row * own[i];
      }
      memcpy(y + LANES * (int64_t)block[b], &taken, sizeof taken);
    }
  }
}
"""


def _calls() -> str:
    return r"""
void interpolate(int fine, int coarse, int64_t rows, int64_t columns, const int64_t *first,
                 const int32_t *block, const float *kept, float *room, const double *x,
                 double *y) {
  const int width = coarse > 4 ? 8 : 4;
  for (int64_t c = 0; c < columns; ++c)
    for (int i = 0; i < width; ++i) room[width * c + i] = i < coarse ? (float)x[coarse * c + i] : 0;
  if (width == 4) {
    FOR_SIZE(interpolate_4, coarse, rows, first, block, kept, room, y)
  } else {
    FOR_SIZE(interpolate_8, coarse, rows, first, block, kept, room, y)
  }
}

void restrict_(int fine, int coarse, int64_t rows, int64_t columns, const int64_t *first,
               const int32_t *block, const float *kept, float *room, const double *x, double *y) {
  const int width = coarse > 4 ? 8 : 4;
  memset(room, 0, sizeof(float) * width * (size_t)columns);
  if (width == 4) {
    FOR_SIZE(restrict_4, coarse, rows, first, block, kept, x, room)
  } else {
    FOR_SIZE(restrict_8, coarse, rows, first, block, kept, x, room)
  }
  for (int64_t c = 0; c < columns; ++c)
    for (int i = 0; i < coarse; ++i) y[coarse * c + i] = room[width * c + i];
}
"""
