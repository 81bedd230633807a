"""Test that packed arrays agree with the originals to the steps of their quantisation."""

import base64
import zlib
from typing import Any

import numpy as np
import pytest

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.report.packing import (
    STEPS,
    Packed,
    pack_integers,
    pack_numbers,
    size_of,
)

pytestmark = pytest.mark.serial


def unpacked(packed: Packed) -> np.ndarray[Any, Any]:
    """Return the array that decode.js unpacks."""
    kind = np.dtype(packed["type"]).newbyteorder("<")
    by_place = np.frombuffer(zlib.decompress(base64.b64decode(packed["data"])), dtype=np.uint8)
    whole = by_place.reshape(kind.itemsize, -1).T.copy().view(kind).ravel()
    return whole if "step" not in packed else packed["low"] + packed["step"] * whole


@pytest.mark.parametrize(
    ("largest", "kind"), [(0, "uint8"), (255, "uint8"), (256, "uint16"), (70_000, "uint32")]
)
def test_integers(largest: int, kind: str) -> None:
    values = np.linspace(0, largest, 12).astype(np.int64).reshape(4, 3)
    packed = pack_integers(values)
    assert packed["type"] == kind
    assert np.array_equal(unpacked(packed), values.ravel())


@pytest.mark.parametrize("values", [np.linspace(-3, 1e4, 1001), np.full(5, -2.5), np.zeros(0)])
def test_numbers(values: Floats) -> None:
    packed = pack_numbers(values)
    range_ = np.ptp(values) if len(values) else 0.0
    assert np.allclose(unpacked(packed), values, rtol=1e-12, atol=0.51 * range_ / STEPS)


def test_what_is_not_finite_becomes_the_smallest() -> None:
    assert unpacked(pack_numbers(np.array([2.0, np.nan, 4.0, np.inf]))) == pytest.approx(
        [2.0, 2.0, 4.0, 2.0]
    )
    assert unpacked(pack_numbers(np.full(2, np.nan))) == pytest.approx([0.0, 0.0])


def test_size() -> None:
    packed = pack_numbers(np.linspace(0, 1, 100))
    assert size_of({"a": [packed, packed], "b": 3}) == 2 * size_of(packed)
    assert size_of(packed) > len(packed["data"])
