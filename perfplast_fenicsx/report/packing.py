"""Pack arrays as text for the page: quantised, deflated, and encoded as base64."""

import base64
import zlib
from typing import Any

import numpy as np
import numpy.typing as npt

STEPS = 65535
"""Number of quantisation steps between the smallest and the largest number."""

Packed = dict[str, Any]
"""A packed array for the page's ``decode.js``: ``type``, ``data``, and for quantised numbers also
``low`` and ``step``. A number is low + step × the stored integer."""


def pack_integers(values: npt.NDArray[np.integer[Any]]) -> Packed:
    """Return non-negative indices, packed in the smallest type that can represent them."""
    largest = int(values.max(initial=0))
    kind = next(a for a in (np.uint8, np.uint16, np.uint32) if largest <= np.iinfo(a).max)
    return {"type": kind.__name__, "data": deflated(values.astype(kind))}


def pack_numbers(values: npt.NDArray[np.floating[Any]]) -> Packed:
    """Return numbers, packed with a resolution of 1/65535 of their range.

    Numbers that are not finite are replaced by the smallest finite number.
    """
    values = values.astype(np.float64)
    finite = np.isfinite(values)
    seen = values[finite] if finite.any() else np.zeros(1)
    low, high = float(seen.min()), float(seen.max())
    step = (high - low) / STEPS
    scaled = (np.where(finite, values, low) - low) / (step if step > 0 else 1.0)
    return {
        "type": "uint16",
        "low": low,
        "step": step,
        "data": deflated(np.rint(scaled).astype(np.uint16)),
    }


def size_of(packed: Any) -> int:
    """Return the number of characters of all packed arrays in nested containers."""
    if isinstance(packed, dict):
        return sum(map(size_of, packed.values()))
    if isinstance(packed, list):
        return sum(map(size_of, packed))
    return len(packed) if isinstance(packed, str) else 0


def deflated(values: npt.NDArray[Any]) -> str:
    """Return the bytes in little-endian order, grouped by place value, deflated, as base64.

    Bytes of equal place value are similar, so they compress better in a group.
    """
    flat = np.ascontiguousarray(values.ravel())
    little = flat.astype(flat.dtype.newbyteorder("<"), copy=False)
    by_place = little.view(np.uint8).reshape(-1, flat.dtype.itemsize).T
    return base64.b64encode(zlib.compress(by_place.tobytes(), 6)).decode("ascii")
