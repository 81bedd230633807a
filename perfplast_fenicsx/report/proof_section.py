"""What of a page says where the proof is, and how it is checked."""

import hashlib
import shlex
from collections.abc import Sequence
from html import escape
from pathlib import Path

from perfplast_fenicsx.io.results.result_files import DIRECTIONS, FALLS, LEAST, PROOF, STANDS
from perfplast_fenicsx.report.tables import pairs


def proofs_of(folder: Path) -> str:
    """The proof files of a result folder, with their fingerprints and the command that checks one.

    Args:
        folder: The results.

    Returns:
        HTML; nothing where there is no such file.
    """
    holds = {  # as far as there is a bound
        PROOF: "a stress that proves the lower bound, and a mechanism that proves the upper one",
        LEAST: "the same of the smallest load factor that is carried",
        STANDS: "a stress within the strengths of the smaller factor of safety",
        FALLS: "a mechanism with the strengths of the larger factor of safety",
    }
    told = [(folder / name, what) for name, what in holds.items() if (folder / name).is_file()]
    ways = sorted(folder.glob(f"{DIRECTIONS}*.h5"))
    files = [path for path, _ in told] + ways
    if not files:
        return ""
    rows = [(path.name, f"{what}; SHA-256 {fingerprint([path])}") for path, what in told]
    if ways:
        what = f"bounds along {len(ways)} directions; SHA-256 of all {fingerprint(ways)}"
        rows.append((f"{DIRECTIONS}*.h5", what))
    command = shlex.join(["python3", "-m", "perfplast_fenicsx.proof", str(files[0])])
    return (
        "<p>Bounds of the bodies are proven by numbers that are on file. They are checked by NumPy"
        " and h5py alone, and by nothing that has found them:</p>"
        f"<pre><code>{escape(command)}</code></pre>{pairs(rows)}"
    )


def fingerprint(paths: Sequence[Path]) -> str:
    """The SHA-256 of files one after the other, as ``cat FILES | sha256sum`` has it."""
    found = hashlib.sha256()
    for path in paths:
        with path.open("rb") as file:
            while block := file.read(1 << 20):
                found.update(block)
    return found.hexdigest()
