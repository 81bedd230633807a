"""Open HDF5 files from untrusted sources: all numbers must be stored in the file itself.

A file can refer to data in other files (links, virtual and external arrays), can declare more
numbers than it stores, and can have groups that contain each other. A path can lead to a pipe to
which no program writes.
"""

import errno
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import h5py
import numpy as np

MOST_OBJECTS = 100_000
"""Largest number of groups and arrays in a file."""

MOST_TEXTS = 1000
"""Largest number of texts in an array; all texts may refer to the same long text."""

SMALL = 1 << 27
"""Size of an array in bytes up to which compression may reduce it to 1/2000 of its size."""

MOST_COMPRESSED = 100
"""Largest ratio of size to stored size for compressed arrays that are larger than SMALL."""


@contextmanager
def stored_file(path: str | Path, beside: tuple[str, ...] = ()) -> Iterator[h5py.File]:
    """Open a file after checking all its contents.

    Args:
        path: The file.
        beside: Names of files to which links may lead, relative to the folder of the file.

    Yields:
        The file, opened for reading.

    Raises:
        OSError: If the file does not exist, or if it cannot be read as HDF5.
        ValueError: If some data are stored neither in the file itself nor in the files ``beside``,
            or if there are too many objects or texts.
    """
    path = Path(path)
    check_regular(path)
    with h5py.File(path, "r", locking=False) as file:
        _check(file, path.parent, frozenset(beside))
        yield file


def check_regular(path: Path) -> None:
    """Check that a path leads to a regular file, not to a pipe, folder or device.

    Raises:
        OSError: If the path leads elsewhere or does not exist.
    """
    if not stat.S_ISREG(path.stat().st_mode):
        raise OSError(errno.EINVAL, "it is not a regular file")


def _check(file: h5py.File, folder: Path, beside: frozenset[str]) -> None:
    """Check every group and array once.

    Raises:
        ValueError: If data are not stored in the file itself, or if there are too many objects.
    """
    waiting: list[h5py.Group] = [file]
    seen = {_address(file)}
    linked: dict[str, list[str]] = {}
    while waiting:
        group = waiting.pop()
        for name in group:
            link = group.get(name, getlink=True)
            if isinstance(link, h5py.ExternalLink):
                if link.filename not in beside:
                    raise ValueError(f"{name} is a link.")
                linked.setdefault(link.filename, []).append(link.path)
                continue
            if not isinstance(link, h5py.HardLink):
                raise ValueError(f"{name} is a link.")
            there = group[name]
            if (address := _address(there)) in seen:
                raise ValueError(f"{name} is another name of an object in the same file.")
            seen.add(address)
            if len(seen) > MOST_OBJECTS:
                raise ValueError(f"there are more than {MOST_OBJECTS} groups and arrays.")
            if isinstance(there, h5py.Group):
                waiting.append(there)
            elif isinstance(there, h5py.Dataset):
                _check_array(name, there)
    for other, places in linked.items():
        _check_linked(folder, other, places)


def _address(there: h5py.Group | h5py.Dataset) -> int:
    """Return the address of a group or an array in the file."""
    return int(h5py.h5o.get_info(there.id).addr)


def _check_linked(folder: Path, other: str, places: list[str]) -> None:
    """Check that the other file is in the folder and contains the linked data.

    Raises:
        ValueError: If the check fails.
    """
    if (folder / other).resolve() != folder.resolve() / other:
        raise ValueError(f"{other} is a link.")
    with stored_file(folder / other) as file:
        for place in places:
            if not isinstance(file.get(place), (h5py.Group, h5py.Dataset)):
                raise ValueError(f"{other} has no {place}.")


def _check_array(name: str, data: h5py.Dataset) -> None:
    """Check that the file stores the numbers of an array.

    Raises:
        ValueError: If the file does not store all numbers.
    """
    if data.is_virtual or data.external:
        raise ValueError(f"{name} is not in the file itself.")
    if data.shape is None:
        return
    count = int(np.prod([int(length) for length in data.shape], dtype=object))
    if data.dtype.kind == "O" and count > MOST_TEXTS:
        raise ValueError(f"{name} has more than {MOST_TEXTS} texts.")
    size, stored = count * data.dtype.itemsize, int(data.id.get_storage_size())
    filtered = data.id.get_create_plist().get_nfilters() > 0
    most = max(stored, min(SMALL, 2000 * stored), MOST_COMPRESSED * stored) if filtered else stored
    if size > most:
        raise ValueError(f"{name} declares {count:.3g} numbers, but the file contains fewer.")
