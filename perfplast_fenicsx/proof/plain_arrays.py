"""Read arrays of numbers from a file or a caller, and check them before use."""

import hashlib
from collections.abc import Mapping
from typing import Any

import h5py
import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.proof.load_kinds import EVERY

FLOATS = (
    *("vertices", "cone_bound", "cone_slope", "cone_matrix", "cone_sine", "cone_tension"),
    *("cone_curvature", "cell_strength", "obstacle_normals", "guided"),
    *EVERY,
    *("contact_adhesion", "contact_friction", "obstacle_adhesion", "obstacle_friction"),
    *("stress", "velocity", "joint_force", "joint_traction", "inner_force", "inner_traction"),
)
LONGS = ("cells", "cone", "facets", "surface", "contacts", "obstacles", "nodes", "rigid")
NUMBERS = (
    *("bound", "factor", "any_factor", "inner_factor", "inner_any_factor"),
    *("revolved", "strength_factor"),
)
"""Names of numbers that a half stores as attributes."""

SHAPING = ("vertices", "velocity", "a cone")
"""Names of numbers whose products with several others may have squares that underflow."""

FLAGS = ("held", "rigid_held", "revolved", "cell_kept", "contact_kept", "obstacle_kept")


class ProofError(ValueError):
    """Raised for a file that is not a proof; the message is one sentence."""


def plain(name: str, values: Any) -> npt.NDArray:
    """Return the values as an array of the type that its name requires: float64, int64 or bool.

    Raises:
        ProofError: If the values have another type, are flags other than 0 and 1, or are too large
            or too small for the checker.
    """
    array = np.asarray(values)
    kinds, what = "fiu", "real numbers"
    if name in LONGS:
        kinds, what = "iu", "whole numbers"
    elif name in FLAGS:
        kinds, what = "biu", "flags, 0 or 1"
    if array.dtype.kind not in kinds or array.dtype.itemsize > 8:
        raise ProofError(
            f"{name} must consist of {what} of at most 8 bytes, but has the type {array.dtype}."
        )
    if name in FLAGS:
        if not ((array == 0) | (array == 1)).all():
            raise ProofError(f"{name} does not consist of {what}.")
        return array.astype(np.bool_)
    if name in LONGS:
        if array.size and not (array.max() < 2**53 and array.min() > -(2**53)):  # exact as doubles
            raise ProofError(f"{name} has numbers that are too large.")
        return array.astype(np.int64)
    numbers = array.astype(np.float64)
    check_sizes(name, np.abs(numbers).max(initial=0.0, where=np.isfinite(numbers)))
    return numbers


def check_sizes(name: str, sizes: npt.ArrayLike) -> None:
    """Refuse numbers so large or so small that products of several may overflow or underflow.

    Args:
        name: Name of the array.
        sizes: Non-negative numbers; an array of zeros is accepted.

    Raises:
        ProofError: If a number is beyond 1e60 or below 1e-60; beyond 1e30 or below 1e-30 for
            vertices, velocities and cones.
    """
    largest = 1e30 if name in SHAPING else 1e60
    sizes = np.asarray(sizes)
    if not ((sizes == 0) | ((sizes >= 1 / largest) & (sizes <= largest))).all():
        exponent = round(np.log10(largest))
        raise ProofError(
            f"{name} is outside the range 1e-{exponent} to 1e{exponent}; choose other units."
        )


def number_of(name: str, values: Any) -> float:
    """Return the value of a stored number as a float.

    Raises:
        ProofError: If the value is not one finite real number, or if it is beyond 1e60 or below
            1e-60.
    """
    array = np.asarray(values)
    if array.shape != () or array.dtype.kind not in "fiu" or array.dtype.itemsize > 8:
        raise ProofError(f"{name} is not a single real number.")
    if not np.isfinite(array):
        raise ProofError(f"{name} is not finite.")
    check_sizes(name, abs(float(array)))
    return float(array)


def bound_of(values: Any, with_constant: bool) -> float:
    """Return a claimed bound, or the stored load factor of its stress.

    Args:
        values: The value in the file.
        with_constant: Whether there are constant loads. Without constant loads, the bodies carry
            the loads at factor zero, so a negative bound is not valid.

    Raises:
        ProofError: If the value is not one finite real number, or is negative without constant
            loads.
    """
    bound = number_of("bound", values)
    if bound < 0 and not with_constant:
        raise ProofError("bound is negative.")
    return bound


def stored_arrays(file: h5py.File, kind: str) -> dict[str, npt.NDArray]:
    """Return the arrays and the numbers of an HDF5 group, as NumPy arrays.

    Args:
        file: File from :func:`stored_file.stored_file`.
        kind: Name of the group.

    Raises:
        ProofError: If the name does not belong to a group of arrays, if an array is not valid or
            declares more numbers than it stores, or if the number ``bound`` is missing.
    """
    group = file[kind]
    if not isinstance(group, h5py.Group):
        raise ProofError("a half is not a group of arrays.")
    found: dict[str, npt.NDArray] = {}
    most_axes = 4  # largest number of axes of a proof's arrays
    for name in (*FLOATS, *LONGS, *FLAGS):
        if name not in group or name == "revolved":  # 'revolved' is a number, not an array
            continue
        data = group[name]
        if not isinstance(data, h5py.Dataset) or data.shape is None:
            raise ProofError(f"{name} is not an array.")
        if len(data.shape) > most_axes:
            raise ProofError(f"the shape of {name} is not valid.")
        if data.dtype.kind not in "biuf":
            raise ProofError(f"{name} does not consist of numbers, but has the type {data.dtype}.")
        size = int(np.prod([int(length) for length in data.shape], dtype=object))
        if size * data.dtype.itemsize > data.id.get_storage_size():
            raise ProofError(f"{name} declares {size:.3g} numbers, but the file contains fewer.")
        found[name] = np.asarray(data)
    if "bound" not in group.attrs:
        raise ProofError("bound is missing.")
    return found | {name: np.asarray(group.attrs[name]) for name in NUMBERS if name in group.attrs}


def equal(one: npt.NDArray, other: npt.NDArray) -> bool:
    """Return whether two arrays are exactly equal; NaN equals NaN."""
    return np.array_equal(one, other, equal_nan=other.dtype.kind == "f")


def checked(arrays: Mapping[str, npt.NDArray], names: tuple[str, ...]) -> dict[str, npt.NDArray]:
    """Return the named arrays with the required types.

    Raises:
        ProofError: If an array is missing or of another type.
    """
    missing = [name for name in names if name not in arrays]
    if missing:
        raise ProofError(f"{', '.join(missing)} is missing.")
    return {name: plain(name, arrays[name]) for name in names}


def digest_of(halves: Mapping[str, Mapping[str, npt.NDArray]]) -> str:
    """Return the SHA-256 of a proof's numbers, independent of types and order in the file.

    The hashed bytes consist of two parts for each half and name, in alphabetical order. The first
    part is the line "half/name shape". The second part contains the numbers as doubles, lowest byte
    first.

    Args:
        halves: Arrays and numbers by name, of "lower", "upper" or both.

    Raises:
        ProofError: If a value is not an array of numbers, or is not a number.
    """
    found = hashlib.sha256()
    for kind in sorted(halves):
        for name in sorted(halves[kind]):
            of = halves[kind][name]
            values = number_of(name, of) if name in NUMBERS else plain(name, of)
            numbers = np.asarray(values, dtype="<f8")
            numbers = np.where(np.isnan(numbers), np.nan, numbers)
            found.update(f"{kind}/{name} {','.join(map(str, numbers.shape))}\n".encode("ascii"))
            found.update(numbers.astype("<f8").tobytes())
    return found.hexdigest()
