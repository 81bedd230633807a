"""HDF5 files of arrays that are distributed over the ranks, written so that no crash harms them.

Rank 0 lays the file out, under another name and with all its room on the disk. Each rank writes its
own rows into it, past HDF5, straight to where the array lies. When all is on the disk the file gets
its name. So nothing is gathered, a full disk is found before a file changes, and every fault is one
of the system, which all ranks can report.
"""

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from mpi4py import MPI

import h5py
import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.arrays import Longs
from perfplast_fenicsx.atomic_files import put
from perfplast_fenicsx.io.results.global_ordering import Ordering
from perfplast_fenicsx.io.results.result_folder import ResultFolder
from perfplast_fenicsx.proof.stored_file import stored_file

LAYOUT = 1 << 16
"""Largest size of what HDF5 writes in addition to the arrays (bytes)."""

GOLDEN = np.uint64(0x9E3779B97F4A7C15)


@dataclass(frozen=True)
class Block:
    """This rank's rows of an array.

    Attributes:
        values: Shape (count, ...), with the same other dimensions on every rank.
        first: Number of the first row.
        total: Rows on all ranks.
    """

    values: npt.NDArray
    first: int
    total: int

    @property
    def shape(self) -> tuple[int, ...]:
        """Return the shape of the whole array."""
        return (self.total, *self.values.shape[1:])


def block(ordering: Ordering, values: npt.NDArray) -> Block:
    """Return values of owned entities as this rank's block of the whole array. Collective."""
    values = np.ascontiguousarray(ordering.to_blocks(values))
    return Block(values, ordering.first, ordering.total)


def write_arrays(
    folder: ResultFolder,
    path: Path,
    blocks: Mapping[str, Block],
    before: Path | None = None,
    describe: Callable[[h5py.File], None] | None = None,
) -> None:
    """Write a file, or replace it. Collective.

    Args:
        folder: Gives the ranks, and the message if the system refuses.
        path: The file; its folder exists.
        blocks: Arrays by name, with the groups they are in; those that only rank 0 has are whole
            there.
        before: What the older file of that name is called from then on; it is replaced if None.
        describe: Called on rank 0 with the file while it is laid out, to add what is small:
            groups, attributes, links, names. There is room for :data:`LAYOUT` bytes.

    Raises:
        InputError: On every rank, where the system refuses; the file is then as it was.
    """
    part = path.with_name(path.name + ".part")
    offsets: dict[str, int] = {}

    def lay_out() -> None:
        part.unlink(missing_ok=True)  # it may be a link that leads elsewhere
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
    """This rank's block of an array. Not collective.

    Raises:
        OSError: If there is no such array of this length, or it cannot be read.
    """
    try:
        with stored_file(path) as file:
            array = file[name]
            if len(array) != ordering.total:
                raise OSError(f"{name} has {len(array)} rows and not {ordering.total}")
            return np.asarray(array[ordering.first : ordering.first + ordering.count])
    except (KeyError, RuntimeError, TypeError, ValueError) as error:
        raise OSError(f"{name} cannot be read: {error}") from error


def checksum(comm: MPI.Intracomm, rows: Block) -> int:
    """Return a checksum of an array, the same however it is distributed. Collective.

    The sum over all entries of a hash of entry and place (the mixer of splitmix64).
    """
    width = max(1, int(np.prod(rows.shape[1:])))
    flat = rows.values.ravel()
    words = flat.view(np.uint64) if flat.itemsize == 8 else flat.astype(np.uint64)
    places = np.arange(words.size, dtype=np.uint64) + np.uint64(rows.first * width)
    hashes = _mixed(words ^ _mixed(places * GOLDEN + GOLDEN))
    total: int = comm.allreduce(int(hashes.sum(dtype=np.uint64)))
    return total % 2**64


def set_checksum(comm: MPI.Intracomm, rows: Longs) -> int:
    """Return a checksum of rows in no order, the same however they are distributed. Collective."""
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
    """Make a file whose arrays have their places, but no values yet; return the places (bytes)."""
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
    """Take room on the disk for a file of this size, which is made if there is none."""
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
