"""Define the header of a checkpoint, and list the checkpoints of a folder.

A checkpoint contains the hashes of its case and its mesh. Its header has its own hash, so that
damage is detected.
"""

import dataclasses
import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np

from perfplast_fenicsx.errors import InputError, raise_together
from perfplast_fenicsx.io.case.schema import Table
from perfplast_fenicsx.io.results.fingerprint import first_difference
from perfplast_fenicsx.io.results.result_files import BEFORE, NEWEST
from perfplast_fenicsx.io.results.result_folder import ResultFolder
from perfplast_fenicsx.mesh.global_ordering import Block
from perfplast_fenicsx.proof.stored_file import stored_file

SCHEMA = 2
"""Version of the content of a checkpoint."""


@dataclass(frozen=True)
class Header:
    """The data of a checkpoint besides its fields; its attributes are the keys of its JSON.

    Attributes:
        schema: :data:`SCHEMA`.
        version: Version of the program.
        case: Content of the case file.
        case_hash: Hash of the case.
        mesh_hash: Hash of the mesh.
        reports: Reports of the levels so far.
        search: State of the search for a limit load.
        timings: Wall time by activity (s).
        checksums: Checksums of the arrays.
    """

    schema: int
    version: str
    case: Table
    case_hash: str
    mesh_hash: str
    reports: list[dict[str, Any]]
    search: dict[str, Any] | None
    timings: dict[str, float]
    checksums: dict[str, int]


def read_header(folder: ResultFolder) -> Header:
    """Return the header of the newest checkpoint that has one. Collective.

    Raises:
        InputError: If no checkpoint has a header, or if it is from another version of this format.
    """
    faults = []
    for path in generations(folder):
        try:
            header = header_of(folder.comm, path)
        except InputError as error:
            faults.append(str(error))
            continue
        if header.schema != SCHEMA:
            raise InputError(
                f"the checkpoint '{path}' has schema {header.schema}, but this version of"
                f" perfplast reads {SCHEMA}; continue with perfplast {header.version}, or start"
                " again with -o."
            )
        return header
    raise nothing_left(folder, faults)


def check_case(folder: ResultFolder, table: Table, name: str) -> None:
    """Refuse a checkpoint of another case. Collective.

    Args:
        folder: Its folder.
        table: Content of the case file.
        name: Name of the case, which messages use.

    Raises:
        InputError: With the first difference.
    """
    difference = first_difference(table, read_header(folder).case)
    if difference is not None:
        raise InputError(
            f"{name}: {difference} in the run whose checkpoint is in '{folder.path}'; restore its"
            " value to continue, or start again with -o."
        )


def packed(header: Header, rank: int) -> Block:
    """Return the header as bytes after a hash of them; complete on rank 0, empty elsewhere."""
    text = json.dumps(dataclasses.asdict(header)).encode()
    data = np.frombuffer(hashlib.sha256(text).digest() + text, dtype=np.uint8)
    return Block(data if rank == 0 else data[:0], 0 if rank == 0 else len(data), len(data))


def header_of(comm: MPI.Intracomm, path: Path) -> Header:
    """Return the header of a checkpoint. Collective.

    Raises:
        InputError: If it cannot be read.
    """
    text, fault = b"", None
    if comm.rank == 0:
        try:
            with stored_file(path) as file:
                data = bytes(np.asarray(file["header"]))
            digest, text = data[:32], data[32:]
            if hashlib.sha256(text).digest() != digest:
                fault = damaged(path, "its header has changed since it was written")
        except FileNotFoundError:
            fault = f"'{path}' is missing"
        except (OSError, KeyError, RuntimeError, TypeError, ValueError) as error:
            fault = damaged(path, error)
    raise_together(comm, fault)
    table = json.loads(comm.bcast(text))
    if table["schema"] != SCHEMA:
        known = {field.name: table.get(field.name) for field in dataclasses.fields(Header)}
        return Header(**known)
    return Header(**table)


def generations(folder: ResultFolder) -> list[Path]:
    """Return the possible checkpoints of a folder, the newest first."""
    return [folder.file(NEWEST), folder.file(BEFORE)]


def damaged(path: Path, reason: object) -> str:
    """Return a sentence on a checkpoint that is damaged."""
    return f"the checkpoint '{path}' is damaged ({' '.join(str(reason).split())})"


def nothing_left(folder: ResultFolder, faults: Sequence[str]) -> InputError:
    """Return the error if no checkpoint of a folder can be used."""
    return InputError(f"{', and '.join(faults)}; start again with -o {folder.path} --force.")
