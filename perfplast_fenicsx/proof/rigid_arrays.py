"""Provide defaults for rigid surfaces if a file has none."""

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt


def with_rigid(arrays: Mapping[str, npt.NDArray]) -> dict[str, npt.NDArray]:
    """Return arrays with empty rigid surfaces if a file has none."""
    d = np.shape(arrays.get("vertices", ()))[1:]
    none: dict[str, npt.NDArray] = {}
    if "rigid" not in arrays:
        none["rigid"] = np.zeros(0, dtype=np.int64)
        none["rigid_held"] = np.zeros((0, *d), dtype=np.uint8)
    return {**none, **arrays}
