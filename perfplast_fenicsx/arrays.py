"""Types of NumPy arrays, by what they hold."""

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
"""Coordinates, normals, lengths, forces."""

Ints = npt.NDArray[np.int32]
"""Local numbers, as DOLFINx has them."""

Longs = npt.NDArray[np.int64]
"""Global numbers, and numbers of NumPy's."""

PairFlags = npt.NDArray[np.bool_]
"""Of contact pairs hosted by this rank, shape (num_pairs,). ``active`` are those closed with a
pushing force, the answer; ``held`` those that a linear system holds closed."""
