"""Facets that are held along one direction beside components, as by planes of symmetry.

A velocity has no part along it there and a traction may have any, as of components that are held:
so their work is zero, whatever the direction. It is the normal of flat surfaces.
"""

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]


def with_guided(arrays: Mapping[str, npt.NDArray]) -> dict[str, npt.NDArray]:
    """Return arrays with no such direction where a file has none."""
    if "guided" in arrays or "facets" not in arrays:
        return dict(arrays)
    return {**arrays, "guided": np.zeros(np.shape(arrays["facets"]))}


def left_free(vectors: Floats, held: Flags, guided: Floats) -> Floats:
    """Return the parts of vectors at facets along free directions.

    Args:
        vectors: Shape (num_facets, n, d).
        held: Components, shape (num_facets, d).
        guided: Unit vectors, 0 for none, the same shape.
    """
    free = vectors * ~held[:, None]
    along = np.where(held, 0.0, guided)
    squares = np.einsum("fi,fi->f", along, along)
    squares[squares == 0] = 1.0
    parts = np.einsum("fni,fi->fn", free, along) / squares[:, None]
    free -= parts[..., None] * along[:, None]
    rounding = 1e-12
    free[np.abs(free) <= rounding * np.abs(vectors).max(axis=2, keepdims=True)] = 0.0
    return free


def differ(one: Floats, other: Floats) -> Flags:
    """Return whether directions differ, shape (n,), by more than rounding and sign."""
    rounding = 1e-9
    apart = [np.abs(one + sign * other).max(axis=1, initial=0) for sign in (-1, 1)]
    return np.asarray(np.minimum(*apart) > rounding)
