"""Compare published factors of safety and limit loads with proven bounds.

    ./fenicsx python3 demos/tribunal/tribunal.py [--only NAME ...] [-o DIR] [--publish]

Each case file in the folder of this script is a problem. If a problem has no bounds, the script
solves it, checks both proofs, and compares the bounds with a log spiral, if possible. Then each
number of ``published.csv`` gets a verdict. The results are stored in DIR, so an interrupted run
continues where it stopped. Problems that ``--only`` does not name keep the bounds of
``bounds.csv``. ``--publish`` copies the tables into the folder of this script, and the page and its
pictures into docs.
"""

import argparse
import hashlib
import os
import re
import resource
import shutil
import subprocess
import sys
import tomllib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from decimal import ROUND_CEILING, ROUND_FLOOR, Decimal
from json import loads
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path[:0] = [] if str(ROOT) in sys.path else [str(ROOT)]

from demos.tribunal.log_spiral import slope_of, upper_bound
from demos.tribunal.page import PICTURES, page
from demos.tribunal.picture import draw
from demos.tribunal.verdicts import (
    Published,
    Solved,
    judged,
    read,
    write_bounds,
    write_verdicts,
)

PUBLISHED, BOUNDS, VERDICTS = "published.csv", "bounds.csv", "verdicts.csv"
PAGE = ROOT / "docs" / "tribunal.md"
PICTURE = "picture.png"
PROOFS = {
    "strength": {"lower": "stands.h5", "upper": "falls.h5"},
    "bounds": {"lower": "bounds.h5", "upper": "bounds.h5"},
    "seismic": {"lower": "bounds.h5", "upper": "bounds.h5"},
}
"""Proof files by the control of a case: for a factor of safety, a load factor, or k_c."""

LONGEST = 1800.0
"""Wall time (s) after which a run is stopped."""

DIGITS = Decimal("1e-5")
"""Unit to which bounds are rounded: the lower bound down, the upper bound up."""


def checksum(path: Path) -> str:
    """Return the SHA-256 of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


# ------------------------------------------------------------------------------- solving


class Failed(Exception):
    """A problem has no bounds; the message states the reason."""


def solve(case: Path, folder: Path) -> Solved:
    """Solve a problem and check its proofs.

    Args:
        case: The case file.
        folder: Folder for a copy of the case and for its results.

    Raises:
        Failed: If the run ends without bounds, or if the checker does not accept a proof.
    """
    folder.mkdir(parents=True, exist_ok=True)
    mine = Path(shutil.copy(case, folder))
    results = folder / "results"
    began = resource.getrusage(resource.RUSAGE_CHILDREN)
    command("perfplast_fenicsx", "run", str(mine), "-o", str(results), "--force", "--quiet")
    ended = resource.getrusage(resource.RUSAGE_CHILDREN)
    spent = ended.ru_utime + ended.ru_stime - began.ru_utime - began.ru_stime
    summary = loads((results / "summary.json").read_text(encoding="utf-8"))
    asked = tomllib.loads(case.read_text(encoding="utf-8"))
    control = asked["loading"]["control"]
    found = summary["limit"]["strength" if control == "strength" else "body"]
    if found["lower"] is None and found["upper"] is None:
        raise Failed(summary["limit"]["verdict"])
    texts, sums, cells = {"lower": "", "upper": ""}, {"lower": "", "upper": ""}, 0
    for side, way in (("lower", ROUND_FLOOR), ("upper", ROUND_CEILING)):
        if found[side] is not None:
            proof = results / PROOFS[control][side]
            cells = max(cells, check_proof(proof, side, found[side], control == "strength"))
            texts[side] = str(Decimal(found[side]).quantize(DIGITS, way))
            sums[side] = checksum(proof)
    return Solved(
        problem=case.stem,
        case=checksum(case),
        lower=texts["lower"],
        upper=texts["upper"],
        spiral="",
        cells=str(cells),
        seconds=f"{spent:.0f}",
        stands=sums["lower"],
        falls=sums["upper"],
    )


def drawn(case: Path, folder: Path) -> Path | None:
    """Return the picture of a problem, and draw it if it is missing; None without a proof.

    Args:
        case: The case file.
        folder: Folder of the problem, with its results.
    """
    picture = folder / PICTURE
    control = tomllib.loads(case.read_text(encoding="utf-8"))["loading"]["control"]
    proof = folder / "results" / PROOFS[control]["upper"]
    if not proof.is_file():
        return picture if picture.is_file() else None
    if not picture.is_file() or picture.stat().st_mtime < proof.stat().st_mtime:
        draw(proof, picture)
    return picture


def with_spiral(row: Solved, case: Path) -> Solved:
    """Return a row with the log spiral of its case, if ``log_spiral.py`` applies.

    Raises:
        Failed: If the log spiral is below the lower bound.
    """
    slope = None if row.spiral else slope_of(tomllib.loads(case.read_text(encoding="utf-8")))
    spiral = None if slope is None else upper_bound(slope)
    if spiral is None:
        return row
    low, _ = row.sides
    if low is not None and spiral < low:
        raise Failed(f"a log spiral collapses at {spiral}, below the proven lower bound {low}")
    return replace(row, spiral=f"{spiral:.5f}")


def check_proof(path: Path, side: str, factor: float, divides: bool) -> int:
    """Check a proof with the checker, in a separate process.

    Args:
        path: The file.
        side: "lower" or "upper".
        factor: The factor that the file must prove.
        divides: Whether the factor divides strengths; otherwise it multiplies loads.

    Returns:
        The number of cells.

    Raises:
        Failed: If the checker does not accept the proof, or if it proves another factor.
    """
    said = command("perfplast_fenicsx.proof", str(path))
    proven = re.search(rf"^{side}: ([\d.e+-]+) is proven", said, re.MULTILINE)
    cells = re.search(r"Taken as written: (\d+) triangles", said)
    if proven is None or cells is None:
        raise Failed(f"{path.name} is not accepted: {said}")
    carried = Decimal(proven[1])
    if not divides:
        if abs(float(carried) / factor - 1) > 1e-6:
            raise Failed(f"{path.name} proves {carried}, not {factor}")
        return int(cells[1])
    divided = re.search(r"divided by F = ([\d.e+-]+?)[.;]?\s", said)
    if divided is None:
        raise Failed(f"{path.name} does not divide strengths: {said}")
    if not (carried >= 1 if side == "lower" else carried <= 1):
        raise Failed(f"{path.name} proves that the loads are carried {carried} times, not once")
    if abs(float(divided[1]) / factor - 1) > 1e-8:
        raise Failed(f"{path.name} is a proof of F = {divided[1]}, not of {factor}")
    return int(cells[1])


def command(module: str, *arguments: str) -> str:
    """Run a module on one core, and return its output.

    Raises:
        Failed: If the exit status is not 0, or if the module takes too long.
    """
    one_core = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    words = [sys.executable, "-m", module, *arguments]
    try:
        ended = subprocess.run(
            words, cwd=ROOT, env=one_core, capture_output=True, text=True, timeout=LONGEST
        )
    except subprocess.TimeoutExpired as error:
        raise Failed(f"{module} did not end within {LONGEST:g} s") from error
    if ended.returncode != 0:
        raise Failed(f"{module} ended with status {ended.returncode}: {ended.stderr.strip()}")
    return ended.stdout


def known(folder: Path, cases: Mapping[str, Path]) -> dict[str, Solved]:
    """Return the bounds stored in a folder that belong to the current case files."""
    rows = read(Solved, folder / BOUNDS)
    return {
        row.problem: row
        for row in rows
        if row.problem in cases and row.case == checksum(cases[row.problem])
    }


# ------------------------------------------------------------------------------- command


def all_cases() -> dict[str, Path]:
    """Return the case files by name."""
    return {case.stem: case for case in sorted(HERE.glob("*.toml"))}


def main(argv: Sequence[str] | None = None) -> int:
    """Solve missing problems, judge all numbers, write the tables; return 1 after a failure."""
    cases = all_cases()
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--only", nargs="+", metavar="NAME", choices=cases, default=list(cases))
    parser.add_argument("-o", metavar="DIR", type=Path, default=ROOT / "build" / "tribunal")
    parser.add_argument(
        "--publish", action="store_true", help="copy tables and page to their place"
    )
    arguments = parser.parse_args(argv)
    folder: Path = arguments.o.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    stored = known(HERE, cases)  # for problems that are not selected
    solved = {name: row for name, row in stored.items() if name not in arguments.only}
    solved |= known(folder, cases)
    failed = []
    left = [name for name in arguments.only if name not in solved]
    for name in set(arguments.only) - set(left):
        solved[name] = with_spiral(solved[name], cases[name])
    for number, name in enumerate(left, 1):
        print(f"[{number}/{len(left)}] {name}", end=" ", flush=True)
        try:
            solved[name] = with_spiral(solve(cases[name], folder / name), cases[name])
        except Failed as error:
            failed.append(name)
            print(f"no bounds: {error}", flush=True)
            continue
        write_bounds(folder / BOUNDS, solved)
        row = solved[name]
        width = row.width
        apart = "" if width is None else f" ({width:.2f} %)"
        print(f"{row.lower or '–'} … {row.upper or '–'}{apart}, {row.cells} cells, {row.seconds} s")
    published = read(Published, HERE / PUBLISHED)
    verdicts = judged(published, solved)
    write_bounds(folder / BOUNDS, solved)
    write_verdicts(folder / VERDICTS, verdicts)
    drawings = {
        name: picture
        for name, row in solved.items()
        if row.upper and (picture := drawn(cases[name], folder / name)) is not None
    }
    (folder / PAGE.name).write_text(page(cases, published, solved), encoding="utf-8")
    if arguments.publish:
        for name in (BOUNDS, VERDICTS):
            shutil.copy(folder / name, HERE)
        shutil.copy(folder / PAGE.name, PAGE)
        pictures = PAGE.parent / PICTURES
        pictures.mkdir(exist_ok=True)
        for name, picture in drawings.items():
            shutil.copy(picture, pictures / f"{name}.png")
    for word, count in Counter(verdict.word for _, verdict in verdicts).most_common():
        print(f"{count:4d} {word}")
    print(f"Tables, page and proofs are in {folder}.")
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main())
