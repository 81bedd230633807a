"""Build the part of a page on the bounds that proof files prove, and on checking the files."""

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
    """Return the verdicts on the proof files of a result folder, which are checked again here.

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
    """Return HTML on the proof files, with their SHA-256 and the checker's command.

    Args:
        folder: The result folder.
        proofs: The verdicts on its proof files.

    Returns:
        The HTML; empty if there are no proof files.
    """
    if not proofs:
        return ""
    halves = {
        "lower": "a stress that proves the lower bound",
        "upper": "a mechanism that proves the upper bound",
    }
    holds = {  # contents of each file
        PROOF: ", and ".join(halves[kind] for kind in halves if kind in proofs.get(PROOF, {})),
        LEAST: "the same for the smallest factor of the load that is carried",
        STANDS: "a stress within the strengths for the smaller factor of safety, which bounds "
        "the multiple of the loads",
        FALLS: "a mechanism with the strengths for the larger factor of safety, which bounds "
        "the multiple of the loads",
    }
    rows = []
    for name, what in holds.items():
        if name in proofs:
            found = _in_words(proofs[name])
            rows.append((name, f"{what}: {found}; SHA-256 {fingerprint([folder / name])}"))
    ways = [folder / name for name in proofs if name not in holds]
    if ways:
        faults = sum(any(half.faults for half in proofs[path.name].values()) for path in ways)
        found = f"{faults} of the files prove less than they claim" if faults else "all are proven"
        what = f"bounds along {len(ways)} directions: {found}; SHA-256 of all {fingerprint(ways)}"
        rows.append((f"{DIRECTIONS}*.h5", what))
    command = shlex.join(
        ["python3", "-m", "perfplast_fenicsx.proof", str(folder / next(iter(proofs)))]
    )
    return (
        "<p>The numbers in these files prove the bounds for the bodies. The checker needs only "
        "NumPy and h5py. It proved the bounds again when this page was made. To run it "
        f"yourself:</p><pre><code>{escape(command)}</code></pre>{pairs(rows)}"
    )


def _in_words(halves: Mapping[str, Checked]) -> str:
    """Return the bounds that the halves of a proof file prove, in words.

    A confirmed bound has the digits of its claim, which the verdict shows too. The proven value may
    differ from the claim by rounding, and then outward rounding would give another last digit.
    """
    words = []
    for kind, half in halves.items():
        if half.proven is None:
            words.append(f"the {kind} bound {half.claimed:.6g} is not proven")
        else:
            rounded = rounded_down if kind == "lower" else rounded_up
            value = half.proven if half.faults else half.claimed
            words.append(f"{kind} bound {rounded(value)} proven")
    return ", ".join(words)


def fingerprint(paths: Sequence[Path]) -> str:
    """Return the SHA-256 of concatenated files, as ``cat FILES | sha256sum`` prints it."""
    found = hashlib.sha256()
    for path in paths:
        with path.open("rb") as file:
            while block := file.read(1 << 20):
                found.update(block)
    return found.hexdigest()
