"""Write HDF5 files of distributed arrays so that a crash does not damage them.

Rank 0 creates the file under a temporary name and reserves its whole size on the disk. Each rank
writes its own rows directly into the file, bypassing HDF5, at the position of the array. The file
gets its final name when all data are on the disk. So no rank gathers an array, and a full disk is
detected before a file changes. Every error comes from the system, and all ranks can report it.
"""

import os
from collections.abc import Callable, Mapping
from pathlib import Path

from mpi4py import MPI

import h5py
import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Longs
from perfplast_fenicsx.atomic_files import put
from perfplast_fenicsx.io.results.result_folder import ResultFolder
from perfplast_fenicsx.mesh.global_ordering import Block, Ordering
from perfplast_fenicsx.proof.stored_file import stored_file

LAYOUT = 1 << 16
"""Largest size of the HDF5 data besides the arrays (bytes)."""

GOLDEN = np.uint64(0x9E3779B97F4A7C15)


def write_arrays(
    folder: ResultFolder,
    path: Path,
    blocks: Mapping[str, Block],
    before: Path | None = None,
    describe: Callable[[h5py.File], None] | None = None,
) -> None:
    """Write a file or replace it. Collective.

    Args:
        folder: Result folder, which provides the ranks and the message for system errors.
        path: The file; its folder exists.
        blocks: Arrays by name, including their groups; arrays that only rank 0 has are complete
            there.
        before: New name of an existing file; None to replace it.
        describe: Function that rank 0 calls with the file during its creation, to add small data:
            groups, attributes, links, names. They may take up to :data:`LAYOUT` bytes.

    Raises:
        InputError: On every rank, if the system refuses; the file is then unchanged.
    """
    part = path.with_name(path.name + ".part")
    offsets: dict[str, int] = {}

    def lay_out() -> None:
        part.unlink(missing_ok=True)  # a link may lead elsewhere
        _reserve(part, LAYOUT + sum(_bytes(block) for block in blocks.values()))
        offsets.update(_lay_out(part, blocks, describe))
        _reserve(part, part.stat().st_size)

    def fill() -> None:
        file = os.open(part, os.O_WRONLY)
        try:
            for name, rows in blocks.items():
                row = _bytes(rows) // max(rows.total, 1)
                _write(file, rows.values, offsets[name] + rows.first * row)
            os.fsync(file)
        finally:
            os.close(file)

    try:
        folder.on_root(lay_out)
        offsets = folder.comm.bcast(offsets)
        folder.on_each(fill)
    except BaseException:
        if folder.comm.rank == 0:
            part.unlink(missing_ok=True)
        raise
    folder.on_root(lambda: put(part, path, before))


def read_rows(path: Path, name: str, ordering: Ordering) -> npt.NDArray:
    """Return this rank's block of an array. Not collective.

    Raises:
        OSError: If there is no array of this length, or if it cannot be read.
    """
    try:
        with stored_file(path) as file:
            array = file[name]
            if len(array) != ordering.total:
                raise OSError(f"{name} has {len(array)} rows instead of {ordering.total}")
            return np.asarray(array[ordering.first : ordering.first + ordering.count])
    except (KeyError, RuntimeError, TypeError, ValueError) as error:
        raise OSError(f"{name} cannot be read: {error}") from error


def checksum(comm: MPI.Intracomm, rows: Block) -> int:
    """Return a checksum of an array, independent of its distribution. Collective.

    The checksum is the sum over all entries of a hash of entry and index (the mixer of splitmix64).
    """
    width = max(1, int(np.prod(rows.shape[1:])))
    flat = rows.values.ravel()
    words = flat.view(np.uint64) if flat.itemsize == 8 else flat.astype(np.uint64)
    places = np.arange(words.size, dtype=np.uint64) + np.uint64(rows.first * width)
    hashes = _mixed(words ^ _mixed(places * GOLDEN + GOLDEN))
    total: int = comm.allreduce(int(hashes.sum(dtype=np.uint64)))
    return total % 2**64


def set_checksum(comm: MPI.Intracomm, rows: Longs) -> int:
    """Return a checksum of unordered rows, independent of their distribution. Collective."""
    hashes: npt.NDArray[np.uint64] = np.full(len(rows), GOLDEN)
    for column in rows.T:
        hashes = _mixed(hashes * GOLDEN ^ column.astype(np.uint64))
    total: int = comm.allreduce(int(hashes.sum(dtype=np.uint64)))
    return total % 2**64


def _mixed(words: npt.NDArray[np.uint64]) -> npt.NDArray[np.uint64]:
    words = (words ^ (words >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    words = (words ^ (words >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return np.asarray(words ^ (words >> np.uint64(31)))


def _bytes(rows: Block) -> int:
    return int(np.prod(rows.shape)) * rows.values.itemsize


def _lay_out(
    part: Path, blocks: Mapping[str, Block], describe: Callable[[h5py.File], None] | None
) -> dict[str, int]:
    """Create a file with positions but no values of its arrays; return the positions (bytes)."""
    early = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    early.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    early.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
    offsets = {}
    try:
        with h5py.File(part, "w", libver="v110", locking=False) as file:
            if describe is not None:
                describe(file)
            for name, rows in blocks.items():
                made = file.create_dataset(name, rows.shape, rows.values.dtype, dcpl=early.copy())
                offsets[name] = made.id.get_offset() or 0
    except (RuntimeError, ValueError) as error:
        raise OSError(str(error)) from error
    return offsets


def _reserve(path: Path, size: int) -> None:
    """Reserve disk space for a file of this size; create the file if it does not exist."""
    file = os.open(path, os.O_WRONLY | os.O_CREAT, 0o666)
    try:
        if size:
            os.posix_fallocate(file, 0, size)
    finally:
        os.close(file)


def _write(file: int, values: npt.NDArray, offset: int) -> None:
    rest = memoryview(values.ravel().view(np.uint8))
    while len(rest):
        written = os.pwrite(file, rest, offset)
        rest, offset = rest[written:], offset + written
