"""Define types of NumPy arrays by content."""

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
"""Coordinates, normals, lengths, forces."""

Ints = npt.NDArray[np.int32]
"""Local numbers, as in DOLFINx."""

Longs = npt.NDArray[np.int64]
"""Global numbers, and NumPy's indices."""

PairFlags = npt.NDArray[np.bool_]
"""Flags of the contact pairs hosted by this rank, shape (num_pairs,). ``active`` pairs are closed
and push; ``held`` pairs are held closed by a linear system."""
