"""Define types of NumPy arrays by their content, and convert Mandel vectors, using only NumPy."""

import math

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
"""Coordinates, normals, lengths, forces."""

Ints = npt.NDArray[np.int32]
"""Local indices, as in DOLFINx."""

Longs = npt.NDArray[np.int64]
"""Global indices, and indices of NumPy."""

PairFlags = npt.NDArray[np.bool_]
"""Flags of the contact pairs that this rank hosts, shape (num_pairs,). ``active`` pairs are closed
and push; a linear system keeps ``held`` pairs closed."""


SHEARS = {4: ((0, 1),), 6: ((1, 2), (0, 2), (0, 1))}
"""Indices (i, j) of the off-diagonal components in a Mandel vector, by its length. These
components follow the diagonal ones."""


def matrices(mandel: Floats) -> Floats:
    """Return the symmetric matrices of Mandel vectors, shape (..., 3, 3) for (..., 4 or 6)."""
    found: Floats = np.zeros((*mandel.shape[:-1], 3, 3))
    for i in range(3):
        found[..., i, i] = mandel[..., i]
    for place, (i, j) in enumerate(SHEARS[mandel.shape[-1]], start=3):
        found[..., i, j] = found[..., j, i] = mandel[..., place] / math.sqrt(2)
    return found


def vectors(symmetric: Floats) -> Floats:
    """Return the Mandel vectors of symmetric matrices, shape (..., 6) for (..., 3, 3)."""
    columns = [symmetric[..., i, i] for i in range(3)]
    columns += [math.sqrt(2) * symmetric[..., i, j] for i, j in SHEARS[6]]
    return np.stack(columns, axis=-1)
