"""Build the part of a page in which the reader's browser proves the bounds again.

The scripts ``assets/proof_*.js`` are a second checker, which was written from ``docs/proof.md`` and
computes residuals in integer arithmetic. The two checkers read the same numbers of a proof file,
but share no code.
"""

from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.proof.checker import numbers_digest
from perfplast_fenicsx.proof.plain_arrays import (
    NUMBERS,
    ProofError,
    equal,
    number_of,
    plain,
    stored_arrays,
)
from perfplast_fenicsx.proof.stored_file import stored_file
from perfplast_fenicsx.report.frame import asset, data_of
from perfplast_fenicsx.report.packing import Packed, deflated, size_of

OF_ONE_HALF = {
    *("stress", "velocity", "nodes", "joint_force", "joint_traction"),
    *("inner_force", "inner_traction"),
}
"""Names of arrays that do not describe the bodies."""


CHECKER = (
    *("exact", "cones", "body", "contact", "lower", "blocks"),
    *("upper", "halves", "verdict"),
)
"""Script files of the checker, in the order in which the browser reads them."""


DIGEST_COMMAND = "python3 -m perfplast_fenicsx.proof --sha256 FILE"
"""Command that prints the SHA-256 of the numbers in a proof file."""


def checker_source() -> str:
    """Return the source code of the checker."""
    return "\n".join(asset(f"proof_{name}.js") for name in CHECKER)


def prove_again(paths: Sequence[Path], room: int) -> str:
    """Return HTML with the proof files, the checker, and a button that starts it.

    Args:
        paths: Proof files, which have been checked.
        room: Largest number of characters of all packed files. The page names each file that does
            not fit.
    """
    packed: dict[str, dict[str, Packed]] = {}
    large, digests = [], []
    for path in paths:
        found = packed_proof(path)
        size = size_of(found)
        if size > room:
            large.append(path.name)
            continue
        packed[path.name], room = found, room - size
        digests.append(f"{path.name} {numbers_digest(path)}")
    words = "".join(
        f"<p>{escape(name)} is too large for this page; the checker above proves its bounds.</p>"
        for name in large
    )
    if not packed:
        return words
    return (
        "<p>This page contains these numbers and a second checker, which shares no line of code"
        " with the first. It proves the bounds here again, without network, and prints the SHA-256"
        " of the numbers that it has read. The page cannot prove that these are the file's numbers;"
        f" <code>{DIGEST_COMMAND}</code> prints the SHA-256 of a file's numbers. When this page was"
        f" made, the values were: {escape(', '.join(digests))}.</p>"
        '<p><button type="button" id="prove">Prove the bounds in this browser</button></p>'
        f'<div id="proven" role="status"></div>{words}'
        f"{data_of('proof-numbers', packed)}"
        f'<script type="text/plain" id="proof-checker">{checker_source()}</script>'
        f"<script>{asset('prove.js')}</script>"
    )


def packed_proof(path: Path) -> dict[str, Packed]:
    """Return the halves of a proof file: ``numbers``, and ``arrays`` by name.

    An array that is equal in both halves is stored once. The upper half then has ``same`` = true,
    and contains only the arrays that differ.

    Args:
        path: The file, which the checker has already read.

    Raises:
        OSError: If the file cannot be read.
        ValueError: If it does not consist of arrays of numbers.
    """
    with stored_file(path) as file:
        halves = {kind: stored_arrays(file, kind) for kind in ("lower", "upper") if kind in file}
    kept = {kind: _plain(half) for kind, half in halves.items()}
    lower, upper = kept.get("lower", {}), kept.get("upper", {})
    same = _names(lower) == _names(upper) and bool(lower)
    found = {}
    for kind, arrays in kept.items():
        beside = lower if same and kind == "upper" else {}
        numbers = {name: _number(name, halves[kind]) for name in NUMBERS if name in halves[kind]}
        packed = {name: _packed(of) for name, of in arrays.items() if not _is(beside, name, of)}
        found[kind] = {"numbers": numbers, "arrays": packed, "same": bool(beside)}
    return found


def _number(name: str, half: dict[str, npt.NDArray]) -> float | None:
    """Return an attribute of a half; None if it is not one finite real number."""
    try:
        return number_of(name, half[name])
    except ProofError:
        return None


def _plain(half: dict[str, npt.NDArray]) -> dict[str, npt.NDArray]:
    return {name: plain(name, of) for name, of in half.items() if name not in NUMBERS}


def _names(arrays: dict[str, npt.NDArray]) -> set[str]:
    return arrays.keys() - OF_ONE_HALF


def _is(arrays: dict[str, npt.NDArray], name: str, values: npt.NDArray) -> bool:
    return name in arrays and equal(arrays[name], values)


def _packed(values: npt.NDArray[Any]) -> Packed:
    """Return an array without loss: its shape, type and bytes."""
    kind: np.dtype[Any] = np.dtype(np.float64)  # a double represents all integers up to 2⁵³
    if values.dtype.kind == "b":
        kind = np.dtype(np.uint8)
    elif values.dtype.kind == "i" and (np.abs(values) < 2**31).all():
        kind = np.dtype(np.int32)
    return {"shape": values.shape, "type": kind.name, "data": deflated(values.astype(kind))}
