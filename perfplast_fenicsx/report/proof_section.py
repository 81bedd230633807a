"""Describe on a page what the proof files prove, and how they are checked."""

import hashlib
import shlex
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path

from perfplast_fenicsx.io.results.claims import Proofs, check_claims, check_factor, proofs_in
from perfplast_fenicsx.io.results.result_files import DIRECTIONS, FALLS, LEAST, PROOF, STANDS
from perfplast_fenicsx.pictures.result_reader import ResultReader
from perfplast_fenicsx.proof.verdict import Checked
from perfplast_fenicsx.report.tables import pairs
from perfplast_fenicsx.rounding import rounded_down, rounded_up


def proofs_of(reader: ResultReader) -> Proofs:
    """Return what the proof files of a result folder prove, after checking them again.

    Raises:
        InputError: If a file cannot be read, or if ``summary.json`` claims a bound that no file
            proves.
    """
    proofs = proofs_in(reader.path)
    if reader.summary.limit is not None:
        check_claims(reader.summary.limit, proofs)
        check_factor(reader.path, reader.summary.limit, proofs)
    return proofs


def proof_section(folder: Path, proofs: Proofs) -> str:
    """Return HTML on the proof files, with fingerprints and the command of the checker.

    Args:
        folder: The result folder.
        proofs: The proofs of its files.

    Returns:
        The HTML; empty without proof files.
    """
    if not proofs:
        return ""
    holds = {  # for each existing bound
        PROOF: "a stress that proves the lower bound, and a mechanism that proves the upper one",
        LEAST: "the same for the smallest load factor that is carried",
        STANDS: "a stress within the strengths of the smaller factor of safety",
        FALLS: "a mechanism with the strengths of the larger factor of safety",
    }
    rows = []
    for name, what in holds.items():
        if name in proofs:
            found = _in_words(proofs[name])
            rows.append((name, f"{what}: {found}; SHA-256 {fingerprint([folder / name])}"))
    ways = [folder / name for name in proofs if name not in holds]
    if ways:
        faults = sum(any(half.faults for half in proofs[path.name].values()) for path in ways)
        found = f"{faults} of them prove less than they claim" if faults else "all are proven"
        what = f"bounds along {len(ways)} directions: {found}; SHA-256 of all {fingerprint(ways)}"
        rows.append((f"{DIRECTIONS}*.h5", what))
    command = shlex.join(
        ["python3", "-m", "perfplast_fenicsx.proof", str(folder / next(iter(proofs)))]
    )
    return (
        "<p>Numbers on file prove the bounds of the bodies. The checker, which needs only "
        "NumPy and h5py, proved them again when this page was made. It also runs on its "
        f"own:</p><pre><code>{escape(command)}</code></pre>{pairs(rows)}"
    )


def _in_words(halves: Mapping[str, Checked]) -> str:
    """Return in words what each half of a file proves."""
    words = []
    for kind, half in halves.items():
        if half.proven is None:
            words.append(f"the {kind} bound {half.claimed:.6g} is not proven")
        else:
            rounded = rounded_down if kind == "lower" else rounded_up
            words.append(f"{kind} bound {rounded(half.proven)} proven")
    return ", ".join(words)


def fingerprint(paths: Sequence[Path]) -> str:
    """Return the SHA-256 of concatenated files, as ``cat FILES | sha256sum`` prints it."""
    found = hashlib.sha256()
    for path in paths:
        with path.open("rb") as file:
            while block := file.read(1 << 20):
                found.update(block)
    return found.hexdigest()
